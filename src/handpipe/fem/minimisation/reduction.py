"""The block of a symmetric matrix that belongs to the unknowns, gathered by indices found once a pattern."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numba import njit, prange

from handpipe.core import Array, BoolArray, Int32Array
from handpipe.fem.patterns.buffers import Buffers
from handpipe.fem.potentials.potential import PARALLEL_ENTRIES, canonical, pattern_of


class FreeBlock:
    """Rows and columns of a mask of unknowns (N,), for all matrices of the pattern of `source`."""

    def __init__(self, source: sp.csr_matrix, free: BoolArray) -> None:
        source.sort_indices()
        self.source = pattern_of(source)
        self._buffers = Buffers()
        self.size = int(free.sum())
        self._all = bool(free.all())
        if not self._all:
            self._indptr, self._indices, self._places = _pattern(source.indptr, source.indices, free)

    def matrix(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """The block of a matrix of the same pattern; all blocks share their index arrays."""
        if self._all:
            return matrix
        data = self._buffers.take(len(self._places))
        if len(data) < PARALLEL_ENTRIES:
            np.take(matrix.data, self._places, out=data, mode="clip")
        else:
            _take(matrix.data, self._places, data)
        return canonical(data, self._indices, self._indptr, (self.size, self.size))


@njit(cache=True, parallel=True)
def _take(values: Array, places: Int32Array, out: Array) -> None:
    for k in prange(len(places)):
        out[k] = values[places[k]]


@njit(cache=True)
def _pattern(
    indptr: Int32Array, indices: Int32Array, free: BoolArray
) -> tuple[Int32Array, Int32Array, Int32Array]:
    n = len(free)
    number = np.full(n, -1, dtype=np.int32)
    count = 0
    for i in range(n):
        if free[i]:
            number[i] = count
            count += 1
    starts = np.zeros(count + 1, dtype=np.int32)
    for i in range(n):
        if free[i]:
            kept = 0
            for k in range(indptr[i], indptr[i + 1]):
                if free[indices[k]]:
                    kept += 1
            starts[number[i] + 1] = starts[number[i]] + kept
    columns = np.empty(starts[count], dtype=np.int32)
    places = np.empty(starts[count], dtype=np.int32)
    at = 0
    for i in range(n):
        if free[i]:
            for k in range(indptr[i], indptr[i + 1]):
                if free[indices[k]]:
                    columns[at] = number[indices[k]]
                    places[at] = k
                    at += 1
    return starts, columns, places
