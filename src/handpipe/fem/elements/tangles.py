"""Tangles of a deformed tet mesh: inverted tets, and edges that their tets surround more than once."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from handpipe.core import Array, IntArray

EDGES = np.array([(0, 1, 2, 3), (0, 2, 3, 1), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 2, 0), (2, 3, 0, 1)])


class Tangles:
    """Counts the tangles of one mesh, tets (m, 4) of n vertices.

    If no tet is inverted, the dihedral angles of the tets around an inner edge sum up to a whole number of
    turns. Two turns mean that the tets overlap: neither volumes nor energy show such a tangle, since it may
    be a minimum.
    """

    def __init__(self, vertices: Array, tets: IntArray) -> None:
        self._rest, self._tets = vertices, tets
        self._edges: IntArray | None = None
        self._inner = np.zeros(0, dtype=bool)

    def count(self, x: Array) -> int:
        """Number of inverted tets and of inner edges that tets do not surround exactly once, at x (n, 3)."""
        if self._edges is None:
            self._find_edges()
        assert self._edges is not None
        turns, flat = _turns(np.ascontiguousarray(x), self._tets, self._edges, len(self._inner))
        return flat + int((np.round(turns[self._inner]) != 1).sum())

    def inverted(self, x: Array) -> int:
        """Number of tets without positive volume at x (n, 3), in a tenth of the time."""
        return int(_inverted(np.ascontiguousarray(x), self._tets))

    def _find_edges(self) -> None:
        pairs = np.sort(self._tets[:, EDGES[:, :2]].reshape(-1, 2), axis=1)
        keys = pairs[:, 0] * (int(self._tets.max()) + 1) + pairs[:, 1]
        found, numbers = np.unique(keys, return_inverse=True)
        self._edges = numbers.reshape(-1, 6)
        turns, _ = _turns(self._rest, self._tets, self._edges, len(found))
        self._inner = np.abs(turns - 1.0) < 1e-6


@njit(cache=True, inline="always")
def _cross(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, inline="always")
def _dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, inline="always")
def _between(x: Array, i: int, j: int) -> tuple[float, float, float]:
    return x[j, 0] - x[i, 0], x[j, 1] - x[i, 1], x[j, 2] - x[i, 2]


@njit(cache=True, inline="always")
def _is_inverted(x: Array, tet: IntArray) -> bool:
    a, b, c, d = tet
    return _dot(_cross(_between(x, a, b), _between(x, a, c)), _between(x, a, d)) <= 0.0


@njit(cache=True)
def _inverted(x: Array, tets: IntArray) -> int:
    count = 0
    for e in range(len(tets)):
        count += _is_inverted(x, tets[e])
    return count


@njit(cache=True)
def _turns(x: Array, tets: IntArray, edges: IntArray, count: int) -> tuple[Array, int]:
    """Sum of dihedral angles at every edge in turns (count,), and the number of inverted tets."""
    turns, flat = np.zeros(count), 0
    for e in range(len(tets)):
        flat += _is_inverted(x, tets[e])
        for k in range(6):
            p = tets[e, EDGES[k, 0]]
            axis = _between(x, p, tets[e, EDGES[k, 1]])
            m = _cross(axis, _between(x, p, tets[e, EDGES[k, 2]]))
            n = _cross(axis, _between(x, p, tets[e, EDGES[k, 3]]))
            angle = math.atan2(_dot(_cross(m, n), axis), _dot(m, n) * math.sqrt(_dot(axis, axis)))
            turns[edges[e, k]] += angle
    return turns / (2.0 * np.pi), flat
