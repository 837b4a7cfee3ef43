"""Small residual motion of a joint as a quadratic function of its angles, tangent beyond the sampled range.

The functions have no constant term: at the neutral pose, angle zero, there is no residual. Inside the range they
are quadratics in the angles; a square t^2 goes on as its tangent beyond the range of t, and products of two
angles stay as they are, which makes the extension C1 everywhere (Wang 2019, section 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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
}
SHRINKAGE = (0.0, 0.3, 1.0, 3.0)  # in units of one pose of typical size


@dataclass(frozen=True)
class Residual:
    """coefficients (k, 3) of `features`; lower, upper (dof,) in rad: range of the samples, with the neutral zero."""

    coefficients: Array
    lower: Array
    upper: Array

    def __call__(self, angles: Array) -> Array:
        """Residuals (n, 3) at angles (n, dof) in rad."""
        return features(np.atleast_2d(angles), self.lower, self.upper) @ self.coefficients


def features(angles: Array, lower: Array, upper: Array) -> Array:
    """phi, phi^2 (n, 2), or phi, psi, phi^2, phi psi, psi^2 (n, 5); squares go on as tangents beyond the range."""
    clamped = np.clip(angles, lower, upper)
    squares = clamped * (2 * angles - clamped)
    if angles.shape[1] == 1:
        return np.column_stack([angles, squares])
    return np.column_stack([angles, squares[:, 0], angles[:, 0] * angles[:, 1], squares[:, 1]])


def fit_residual(angles: Array, samples: Array, terms: Terms, shrinkage: float) -> Residual:
    """Ridge regression of samples (n, 3) at angles (n, dof) with the given terms.

    Each term is scaled by its root mean square over the samples, so that `shrinkage` acts on all terms alike:
    with 0 the fit is plain least squares, with 1 the prior of a vanishing residual counts as much as one pose.
    """
    lower, upper = np.minimum(angles.min(axis=0), 0), np.maximum(angles.max(axis=0), 0)
    every = features(angles, lower, upper)
    coefficients = np.zeros((every.shape[1], 3))
    if terms:
        chosen = every[:, terms]
        scale = np.maximum(np.sqrt((chosen**2).mean(axis=0)), 1e-12)
        prior = np.sqrt(shrinkage) * np.eye(len(terms))
        system = np.vstack([chosen / scale, prior])
        right = np.vstack([samples, np.zeros((len(terms), 3))])
        coefficients[list(terms)] = np.linalg.lstsq(system, right, rcond=1e-9)[0] / scale[:, None]
    return Residual(coefficients, lower, upper)
