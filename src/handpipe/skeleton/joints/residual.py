"""Small residual motion of a joint as a quadratic function of its angles, tangent beyond the sampled range.

The functions have no constant term: at the neutral pose, angle zero, there is no residual. Inside the
range they are quadratics in the angles; a square t^2 goes on as its tangent beyond the range of t, and
products of two angles stay as they are: the extension is C1 everywhere (Wang 2019, section 4).

With a handful of poses, noise and residual motion are of one size, and picking one order would often pick
noise. Ridge fits of several orders are therefore mixed by the weights, none negative, that predict left-out
poses best (stacked regression, Breiman 1996); weights that sum to less than one shrink towards no residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from handpipe.core import Array

Terms = tuple[int, ...]  # which columns of `features` a function uses

# From simple to rich: a later choice has to predict better to be taken.
TERMS: dict[int, tuple[Terms, ...]] = {
    1: ((), (0,), (0, 1)),  # of phi, phi^2
    2: (
        (),
        (0,),
        (0, 1),
        (0, 2),
        (0, 1, 2),
        (0, 1, 2, 4),
        (0, 1, 2, 3, 4),
    ),  # of phi, psi, phi^2, phi psi, psi^2
    3: ((), (0, 1, 2), tuple(range(9))),  # of the angles, their squares, their products
}
SPARE = 2  # poses beyond a function's coefficients: with fewer it says nothing of pairs of angles not seen
SHRINKAGE = (0.0, 0.3, 1.0, 3.0)  # in units of one pose of typical size


@dataclass(frozen=True)
class Residual:
    """A function of joint angles with three components.

    Parameters
    ----------
    coefficients : array (k, 3)
        Coefficients of `features`.
    lower, upper : array (dof,)
        Range in rad of the samples and neutral.
    """

    coefficients: Array
    lower: Array
    upper: Array

    def __call__(self, angles: Array) -> Array:
        """Residuals (n, 3) at angles (n, dof) in rad."""
        return features(np.atleast_2d(angles), self.lower, self.upper) @ self.coefficients

    def rates(self, angles: Array) -> Array:
        """Derivatives (dof, 3) by each of the angles (dof,) in rad."""
        return feature_rates(angles, self.lower, self.upper).T @ self.coefficients


def features(angles: Array, lower: Array, upper: Array) -> Array:
    """phi, phi^2 (n, 2), or phi, psi, phi^2, phi psi, psi^2 (n, 5); squares as tangents beyond the range.

    Of three angles (n, 9): the angles, their squares, and the products of the first two, first and last,
    last two.
    """
    if angles.shape[1] == 0:
        return np.zeros((len(angles), 0))
    clamped = np.clip(angles, lower, upper)
    squares = clamped * (2 * angles - clamped)
    if angles.shape[1] == 1:
        return np.column_stack([angles, squares])
    if angles.shape[1] == 3:
        phi, psi, chi = angles.T
        return np.column_stack([angles, squares, phi * psi, phi * chi, psi * chi])
    return np.column_stack([angles, squares[:, 0], angles[:, 0] * angles[:, 1], squares[:, 1]])


def feature_rates(angles: Array, lower: Array, upper: Array) -> Array:
    """Derivatives (k, dof) of `features` at angles (dof,)."""
    dof, slopes = len(angles), 2 * np.clip(angles, lower, upper)
    if dof == 0:
        return np.zeros((0, 0))
    if dof == 1:
        return np.array([[1.0], slopes])
    if dof == 3:
        phi, psi, chi = angles
        return np.vstack([np.eye(3), np.diag(slopes), [[psi, phi, 0], [chi, 0, phi], [0, chi, psi]]])
    phi, psi = angles
    return np.array([[1, 0], [0, 1], [slopes[0], 0], [psi, phi], [0, slopes[1]]], float)


def fit_residual(angles: Array, samples: Array, weights: Array | None = None) -> Residual:
    """The function that predicts left-out residuals best.

    Parameters
    ----------
    angles : array (n, dof)
        Angles in rad of the samples.
    samples : array (n, 3)
        Residuals.
    weights : array (n,), optional
        Inverse deviations of the samples, up to a factor.

    Returns
    -------
    Residual
        Function of the angles.
    """
    counts = np.ones(len(samples)) if weights is None else weights
    most = max(len(samples) - SPARE, 1)
    known = [terms for terms in TERMS[angles.shape[1]] if len(terms) <= most]
    choices = [(terms, shrinkage) for terms in known for shrinkage in SHRINKAGE]
    fits = [fit_ridge(angles, samples, *choice, weights=counts) for choice in choices]
    mixture = np.zeros(len(choices))
    if len(samples) > 1:
        others = [np.arange(len(samples)) != i for i in range(len(samples))]
        predictions = [
            np.concatenate(
                [
                    fit_ridge(angles[rest], samples[rest], *choice, weights=counts[rest])(angles[~rest])
                    for rest in others
                ]
            )
            for choice in choices
        ]
        weighted = [(counts[:, None] * p).ravel() for p in predictions]
        mixture = nnls(np.array(weighted).T, (counts[:, None] * samples).ravel())[0]
        mixture = mixture / max(mixture.sum(), 1.0)
    coefficients = np.tensordot(mixture, np.array([f.coefficients for f in fits]), axes=1)
    return Residual(coefficients, fits[0].lower, fits[0].upper)


def fit_ridge(
    angles: Array, samples: Array, terms: Terms, shrinkage: float, *, weights: Array | None = None
) -> Residual:
    """Ridge regression of samples (n, 3) at angles (n, dof) with the given terms, weights (n,) on the rows.

    Each term is scaled by its root mean square over the samples, so that `shrinkage` acts on all terms
    alike: 0 is plain least squares, with 1 the prior of no residual counts as much as one pose.
    """
    counts = np.ones((len(samples), 1)) if weights is None else weights[:, None]
    lower, upper = np.minimum(angles.min(axis=0), 0), np.maximum(angles.max(axis=0), 0)
    every = features(angles, lower, upper)
    chosen = every[:, terms]
    scale = np.maximum(np.sqrt((chosen**2).mean(axis=0)), 1e-12)
    system = np.vstack([counts * chosen / scale, np.sqrt(shrinkage) * np.eye(len(terms))])
    right = np.vstack([counts * samples, np.zeros((len(terms), 3))])
    coefficients = np.zeros((every.shape[1], 3))
    coefficients[list(terms)] = np.linalg.lstsq(system, right, rcond=1e-9)[0] / scale[:, None]
    return Residual(coefficients, lower, upper)
