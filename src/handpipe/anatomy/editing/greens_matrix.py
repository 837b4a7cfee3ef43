"""Green's functions of a Laplacian between vertices of a mesh, by one factor that is kept."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.anatomy.templates.diffusion import Factorise, block
from handpipe.core import Array, IntArray

BATCH = 128  # columns that are solved for together: as many as fill the cache
ROOM = 3000  # vertices whose values are kept at first


class GreensMatrix:
    """Entries of the inverse of a Laplacian that is fixed at some vertices.

    An entry is the value at one vertex of the solution for a unit load at another. Entries that were once
    asked for are kept: curves that are dragged come through the same vertices again and again.

    Parameters
    ----------
    laplacian : sparse matrix (n, n)
        Of the whole mesh.
    fixed : array (f,)
        Vertices at which solutions are zero; the matrix of the others is positive definite.
    factorise : callable
        Factors symmetric positive definite matrices.
    """

    def __init__(self, laplacian: sparse.csr_matrix, fixed: IntArray, factorise: Factorise) -> None:
        count = laplacian.shape[0]
        self.free = np.setdiff1d(np.arange(count), fixed)
        self._count = count
        self._factor = factorise(block(laplacian, self.free))
        self._row = np.full(count, -1)
        self._row[self.free] = np.arange(len(self.free))
        self._place = np.full(len(self.free), -1)
        self._known = np.zeros(0, np.int64)
        self._entries = np.zeros((ROOM, ROOM))

    def solve(self, loads: Array) -> Array:
        """Values (n, k) for loads (n, k) at the vertices; zero where they are fixed."""
        values = np.zeros((self._count, loads.shape[1]))
        values[self.free] = self._factor.solve(np.asfortranarray(loads[self.free]))
        return values

    def between(self, vertices: IntArray) -> Array:
        """Entries (v, v) of the inverse between vertices (v,); zero where they are fixed."""
        rows = self._row[vertices]
        free = np.flatnonzero(rows >= 0)
        self._learn(rows[free])
        found = np.zeros((len(vertices), len(vertices)))
        places = self._place[rows[free]]
        found[np.ix_(free, free)] = self._entries[np.ix_(places, places)]
        return found

    def _learn(self, rows: IntArray) -> None:
        """Solve for the columns of rows that are not known yet."""
        new = np.unique(rows[self._place[rows] < 0])
        if len(self._known) + len(new) > len(self._entries):
            self._forget_all_but(np.unique(rows[self._place[rows] >= 0]), len(new))
        first = len(self._known)
        self._known = np.concatenate([self._known, new])
        self._place[new] = np.arange(first, len(self._known))
        for start in range(first, len(self._known), BATCH):
            columns = slice(start, min(start + BATCH, len(self._known)))
            loads = np.zeros((len(self.free), columns.stop - start), order="F")
            loads[self._known[columns], np.arange(loads.shape[1])] = 1.0
            values = self._factor.solve(loads)[self._known]
            self._entries[: len(self._known), columns] = values
            self._entries[columns, : len(self._known)] = values.T

    def _forget_all_but(self, rows: IntArray, further: int) -> None:
        places = self._place[rows]
        kept = self._entries[np.ix_(places, places)]
        room = max(ROOM, 2 * (len(rows) + further))
        self._entries = np.zeros((room, room))
        self._entries[: len(rows), : len(rows)] = kept
        self._known = rows
        self._place[:] = -1
        self._place[rows] = np.arange(len(rows))
