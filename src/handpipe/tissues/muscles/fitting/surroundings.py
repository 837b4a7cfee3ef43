"""A guess of where a body is in a pose, from the motion of its surroundings."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RBFInterpolator

from handpipe.core import Array

REACH = 8.0  # mm about a body's box within which its surroundings tell where it goes
ENOUGH = 2000  # of their points: a dense system
SMOOTHING = 0.1  # mm: surfaces that touch have slid on one another


def carried_along(points: Array, rest: Array, posed: Array) -> Array:
    """Points (n, 3) moved as places around them did, from rest (m, 3) to posed (m, 3).

    Displacements are interpolated by biharmonic radial functions with a linear part.
    """
    low, high = points.min(axis=0) - REACH, points.max(axis=0) + REACH
    near = np.flatnonzero(((rest > low) & (rest < high)).all(axis=1))
    chosen = np.random.default_rng(0).permutation(near)[:ENOUGH]
    field = RBFInterpolator(
        rest[chosen], (posed - rest)[chosen], kernel="linear", degree=1, smoothing=SMOOTHING
    )
    return np.asarray(points + field(points))
