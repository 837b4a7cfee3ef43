"""Probability of being bone from what a voxel looks like, learned from the strokes.

Logistic regression on random Fourier features (Rahimi and Recht 2007): a smooth boundary of any shape in the
space of looks, from one convex problem. Bone and background weigh the same, however long their strokes are.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit

from handpipe.core import Array, BoolArray
from handpipe.imaging.learned.features import AXES

log = logging.getLogger(__name__)
WAVES = 600  # random features
WIDTH = 4.0  # of the kernel, in deviations of the features
NEARBY = 4.0  # times as much a voxel's place counts: a tissue's look varies over the image
RIDGE = 1e-4  # of the squared weights, against the mean loss
CHUNK = 50_000  # voxels at once
ITERATIONS = 150  # at most


@dataclass(frozen=True)
class Classifier:
    """A learned look: a logistic function of waves through the space of features.

    Parameters
    ----------
    middle : array (f,)
        Mean of each feature in the strokes.
    waves : array (f, m)
        Wave vectors.
    phases : array (m,)
        Phase of each wave.
    weights : array (m + 1,)
        Weight of each wave, and the offset.
    """

    middle: Array
    waves: NDArray
    phases: NDArray
    weights: NDArray

    def probability(self, features: NDArray) -> NDArray[np.float32]:
        """Probability (n,) of being bone for looks (n, f)."""
        out = np.empty(len(features), np.float32)
        for first in range(0, len(features), CHUNK):
            part = slice(first, first + CHUNK)
            lifted = _lifted(features[part] - self.middle, self.waves, self.phases)
            out[part] = expit(lifted @ self.weights[:-1] + self.weights[-1])
        return out


def _lifted(features: NDArray, waves: NDArray, phases: NDArray) -> NDArray:
    """Values (n, m) of the waves."""
    return np.asarray(np.cos(features.astype(np.float32) @ waves + phases) * np.float32(len(phases) ** -0.5))


def learn(features: NDArray, bone: BoolArray, nearby: float = NEARBY) -> Classifier:
    """Fit a classifier to labelled looks.

    Parameters
    ----------
    features : array (n, f)
        Looks of the strokes' voxels; the last `AXES` columns are their places.
    bone : array (n,) of bool
        Which of them are bone.
    nearby : float, optional
        How much a voxel's place counts; 0 for looks alone.

    Returns
    -------
    Classifier
        The learned look.
    """
    random = np.random.default_rng(0)
    middle, deviation = features.mean(axis=0, dtype=float), features.std(axis=0, dtype=float)
    waves = random.standard_normal((features.shape[1], WAVES)) / WIDTH
    waves[-AXES:] *= nearby
    waves = (waves / np.maximum(deviation, 1e-6)[:, None]).astype(np.float32)
    phases = random.uniform(0, 2 * np.pi, WAVES).astype(np.float32)
    weights = _fitted(_lifted(features - middle, waves, phases), bone)
    return Classifier(middle, waves, phases, weights)


def _fitted(lifted: NDArray, bone: BoolArray) -> NDArray:
    """Weights (m + 1,) of the logistic regression."""
    share = np.where(bone, 0.5 / max(bone.sum(), 1), 0.5 / max((~bone).sum(), 1))
    sign = np.where(bone, 1.0, -1.0)

    def loss(weights: NDArray) -> tuple[float, NDArray]:
        margin = sign * (lifted @ weights[:-1] + weights[-1])
        slope = -share * sign * expit(-margin)
        ridge = np.append(weights[:-1], 0.0) * RIDGE
        value = share @ np.logaddexp(0, -margin) + 0.5 * ridge @ weights
        return float(value), np.append(slope @ lifted, slope.sum()) + ridge

    start = np.zeros(lifted.shape[1] + 1)
    found = minimize(loss, start, jac=True, method="L-BFGS-B", options={"maxiter": ITERATIONS})
    if not found.success:
        log.warning("the look of a bone was not learned to the end: %s", found.message)
    return np.asarray(found.x, np.float32)
