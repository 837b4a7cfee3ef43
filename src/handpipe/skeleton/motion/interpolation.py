"""Angles between keys: monotone cubic splines, which leave no range that their keys span."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from handpipe.core import Array
from handpipe.skeleton.joints.angles import Angles


def spline(times: Array, values: Array, at: Array) -> Array:
    """Values (n, ...) at times (n,) of the monotone cubic through (k, ...) at times (k,); constant beyond.

    Between two keys it stays between their values, so that it needs no limits of its own.

    References
    ----------
    Fritsch, F. N. and Butland, J. (1984), A method for constructing local monotone piecewise cubic
    interpolants, SIAM J. Sci. Stat. Comput. 5.
    """
    if len(times) == 1:
        return np.repeat(values, len(at), axis=0)
    found: Array = PchipInterpolator(times, values, axis=0)(np.clip(at, times[0], times[-1]))
    return np.clip(found, values.min(axis=0), values.max(axis=0))  # rounding alone


def angles_between(
    times: Array, keys: Sequence[Mapping[str, float]], names: Sequence[str], at: Array
) -> list[Angles]:
    """Angles in rad at times (n,) by splines through keys at times (k,).

    Parameters
    ----------
    times : array (k,)
        Times of the keys, increasing.
    keys : sequence of mapping of str to float
        Angles in rad that each key gives. An angle passes the keys that give it, and is zero if none does.
    names : sequence of str
        All angles.
    at : array (n,)
        Times of the frames.

    Returns
    -------
    list of dict of str to float
        All angles in rad of each frame.
    """
    columns = np.zeros((len(at), len(names)))
    for i, name in enumerate(names):
        given = [k for k, angles in enumerate(keys) if name in angles]
        if given:
            columns[:, i] = spline(times[given], np.array([keys[k][name] for k in given]), at)
    return [dict(zip(names, map(float, row), strict=True)) for row in columns]
