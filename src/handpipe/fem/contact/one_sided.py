"""The penalty of one-sided contact: zero outside, smooth where it sets in, then quadratic."""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.core import Array


def penalty(depth: Array, onset: float) -> tuple[Array, Array, Array]:
    """Twice continuously differentiable one-sided penalty of depths, with its derivatives.

    Zero for depth <= 0, depth^3 / (6 onset) up to `onset`, then quadratic of unit curvature.

    Parameters
    ----------
    depth : array (k,)
        Depths in mm, negative outside.
    onset : float
        Depth in mm where the curvature reaches one; zero or less: depth^2 / 2 from the start, whose second
        derivative jumps.

    Returns
    -------
    value : array (k,)
        Penalty in mm^2; times a stiffness in mN/mm it is an energy in µJ.
    first : array (k,)
        First derivative in mm.
    second : array (k,)
        Second derivative, 0 to 1.
    """
    return _penalty(np.asarray(depth, dtype=float), onset)


@njit(cache=True)
def _penalty(depth: Array, onset: float) -> tuple[Array, Array, Array]:
    """`penalty`, without an array for each of its terms."""
    value, first, second = np.empty_like(depth), np.empty_like(depth), np.empty_like(depth)
    for i in range(len(depth)):
        d = max(depth[i], 0.0)
        if onset <= 0.0:
            value[i], first[i], second[i] = 0.5 * d**2, d, 1.0 if d > 0.0 else 0.0
        elif d < onset:
            value[i], first[i], second[i] = d**3 / (6 * onset), d**2 / (2 * onset), d / onset
        else:
            value[i] = 0.5 * d**2 - 0.5 * onset * d + onset**2 / 6
            first[i], second[i] = d - 0.5 * onset, 1.0
    return value, first, second
