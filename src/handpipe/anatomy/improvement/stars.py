"""Stars of vertices in a tet mesh and the quality of tets, which local operations compare."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from handpipe.core import Array, IntArray

OUTSIDE = 62  # bit of the outside in the set of regions at a vertex
MOST_LABELS = OUTSIDE  # labels of a domain: bits below that of the outside
BETTER = 1.001  # times the quality before: a smaller gain changes nothing


@njit(cache=True, inline="always")
def _volume6(a, b, c, d):  # type: ignore[no-untyped-def]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    return (uy * vz - uz * vy) * wx + (uz * vx - ux * vz) * wy + (ux * vy - uy * vx) * wz


@njit(cache=True, inline="always")
def _area2(a, b, c):  # type: ignore[no-untyped-def]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return np.sqrt(x * x + y * y + z * z)


@njit(cache=True, inline="always")
def _length(a, b):  # type: ignore[no-untyped-def]
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit(cache=True)
def least_sine(a, b, c, d):  # type: ignore[no-untyped-def]
    """Least sine of the six dihedral angles of a tet with corners (3,), negative where it is inverted.

    The sine at an edge is 3/2 of volume times length over the product of the areas of both its faces.
    """
    volume = _volume6(a, b, c, d)
    fa, fb, fc, fd = _area2(b, c, d), _area2(a, c, d), _area2(a, b, d), _area2(a, b, c)
    if fa <= 0 or fb <= 0 or fc <= 0 or fd <= 0:
        return -1.0
    low = _length(a, b) / (fc * fd)
    low = min(low, _length(a, c) / (fb * fd))
    low = min(low, _length(a, d) / (fb * fc))
    low = min(low, _length(b, c) / (fa * fd))
    low = min(low, _length(b, d) / (fa * fc))
    low = min(low, _length(c, d) / (fa * fb))
    return volume * low


@njit(cache=True)
def least_sines(x: Array, tets: IntArray) -> Array:
    """The `least_sine` (m,) of tets (m, 4) on vertices x (n, 3).

    A tet with a corner below zero does not exist; its value is 2.
    """
    out = np.full(len(tets), 2.0)
    for t in range(len(tets)):
        if tets[t, 0] >= 0:
            out[t] = least_sine(x[tets[t, 0]], x[tets[t, 1]], x[tets[t, 2]], x[tets[t, 3]])
    return out


class Stars(NamedTuple):
    """Tets around each vertex: `tets[start[v]:start[v + 1]]`; compiled functions take it as it is."""

    start: IntArray
    tets: IntArray

    @staticmethod
    def build(tets: IntArray, n_vertices: int) -> Stars:
        """Of tets (m, 4) on so many vertices."""
        return Stars(*_stars(tets, n_vertices))


@njit(cache=True)
def _stars(tets, n):  # type: ignore[no-untyped-def]
    start = np.zeros(n + 1, np.int64)
    for t in range(len(tets)):
        for i in range(4):
            start[tets[t, i] + 1] += 1
    for v in range(n):
        start[v + 1] += start[v]
    fill = start[:-1].copy()
    out = np.empty(4 * len(tets), np.int64)
    for t in range(len(tets)):
        for i in range(4):
            out[fill[tets[t, i]]] = t
            fill[tets[t, i]] += 1
    return start, out


def regions_at_vertices(tets: IntArray, labels: IntArray, boundary: IntArray, n_vertices: int) -> IntArray:
    """Which labels, and whether the outside, meet at each vertex: bits of a number (n,)."""
    out = np.zeros(n_vertices, dtype=np.int64)
    np.bitwise_or.at(out, tets, np.left_shift(np.int64(1), labels)[:, None])
    out[boundary] |= np.int64(1) << OUTSIDE
    return out
