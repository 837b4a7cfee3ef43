"""A sparsity pattern that grows with the matrices it gets, so that it rarely changes between steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numba import njit

from handpipe.core import Int32Array

EXCESS = 4  # a pattern with so many times the entries that are needed is given up


class GrowingPattern:
    """Hands matrices out in one pattern, which shares its index arrays for as long as it suffices.

    Contacts open and close at every step; with this pattern the sums and factorisations that contain the
    Hessian need no new analysis each time.
    """

    def __init__(self) -> None:
        self._pattern: sp.csr_matrix | None = None
        self.changes = 0

    def hold(self, structure: sp.csr_matrix, foreseen: Callable[[], sp.csr_matrix]) -> None:
        """Make room for the entries of a matrix; if the pattern must grow, for those of `foreseen()` too."""
        structure.sort_indices()
        if self._pattern is None or np.any(self._places(structure) < 0):
            self._grow(structure, foreseen())

    def fit(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """The matrix in the pattern, with zeros where it has no entry."""
        matrix.sort_indices()
        if self._pattern is None or np.any(self._places(matrix) < 0):
            self._grow(matrix, matrix)
        assert self._pattern is not None
        data = np.zeros(self._pattern.nnz)
        data[self._places(matrix)] = matrix.data
        arrays = (data, self._pattern.indices, self._pattern.indptr)
        return sp.csr_matrix(arrays, shape=matrix.shape, copy=False)

    def _places(self, matrix: sp.csr_matrix) -> Int32Array:
        assert self._pattern is not None
        return _places(matrix.indptr, matrix.indices, self._pattern.indptr, self._pattern.indices)

    def _grow(self, matrix: sp.csr_matrix, foreseen: sp.csr_matrix) -> None:
        needed = _ones(matrix) + _ones(foreseen)
        if self._pattern is not None:
            union = needed + self._pattern
            needed = union if union.nnz <= EXCESS * needed.nnz else needed
        needed.sort_indices()
        self._pattern = _ones(needed)
        self.changes += 1


def _ones(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """Ones in a matrix's pattern."""
    return sp.csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)


@njit(cache=True)
def _places(
    indptr: Int32Array, indices: Int32Array, wide_indptr: Int32Array, wide_indices: Int32Array
) -> Int32Array:
    """Where each entry of a matrix stands in a wider pattern, -1 where it does not; rows are sorted."""
    out = np.full(len(indices), -1, dtype=np.int32)
    for row in range(len(indptr) - 1):
        at, end = wide_indptr[row], wide_indptr[row + 1]
        for k in range(indptr[row], indptr[row + 1]):
            while at < end and wide_indices[at] < indices[k]:
                at += 1
            if at < end and wide_indices[at] == indices[k]:
                out[k] = at
    return out
