"""What every physical effect is: a potential energy of vertex positions, with gradient and Hessian."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]


@runtime_checkable
class Potential(Protocol):
    """An energy of positions x (n, 3) in mm. Degree of freedom of vertex i, coordinate c is 3 i + c.

    A potential may also offer `max_step(x, step) -> float`, the largest fraction in (0, 1] of a displacement
    that it allows, and `refresh(x) -> None`, called between Newton steps, where it may renew what it holds
    constant.
    """

    def value(self, x: Array) -> float:
        """Energy in microjoules."""
        ...

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force."""
        ...

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm; with `project`, a positive semidefinite stand-in."""
        ...


class Sum:
    """The sum of potentials. The union of their patterns is kept for as long as these stay the same."""

    def __init__(self, potentials: Sequence[Potential]) -> None:
        self.potentials = list(potentials)
        self._parts: list[sp.csr_matrix] = []
        self._indptr = self._indices = np.zeros(0, dtype=np.int32)
        self._places: list[Int32Array] = []

    def value(self, x: Array) -> float:
        return float(sum(p.value(x) for p in self.potentials))

    def gradient(self, x: Array) -> Array:
        total = np.zeros_like(x)
        for potential in self.potentials:
            total += potential.gradient(x)
        return total

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        matrices = [p.hessian(x, project) for p in self.potentials]
        if len(matrices) == 1:
            return matrices[0]
        if not self._same_patterns(matrices):
            self._merge(matrices)
        data = np.zeros(len(self._indices))
        for matrix, places in zip(matrices, self._places, strict=True):
            _add_at(data, places, matrix.data)
        return sp.csr_matrix((data, self._indices, self._indptr), shape=matrices[0].shape, copy=False)

    def max_step(self, x: Array, step: Array) -> float:
        limits = [p.max_step(x, step) for p in self.potentials if hasattr(p, "max_step")]
        return min([1.0, *limits])

    def refresh(self, x: Array) -> None:
        for potential in self.potentials:
            if hasattr(potential, "refresh"):
                potential.refresh(x)

    def _same_patterns(self, matrices: list[sp.csr_matrix]) -> bool:
        return len(matrices) == len(self._parts) and all(
            same_pattern(a, b) for a, b in zip(matrices, self._parts, strict=True)
        )

    def _merge(self, matrices: list[sp.csr_matrix]) -> None:
        rows, columns = matrices[0].shape
        union = sp.csr_matrix((rows, columns))
        for m in matrices:
            m.sort_indices()
            union = union + sp.csr_matrix((np.ones(m.nnz), m.indices, m.indptr), shape=m.shape)
        union.sort_indices()
        self._indptr, self._indices = union.indptr, union.indices
        self._places = [_places(m.indptr, m.indices, union.indptr, union.indices) for m in matrices]
        self._parts = matrices


def same_pattern(a: sp.csr_matrix, b: sp.csr_matrix) -> bool:
    """Whether two CSR matrices have the same pattern; immediate where they share their index arrays."""
    if np.shares_memory(a.indices, b.indices) and a.nnz == b.nnz:
        return True
    return a.nnz == b.nnz and np.array_equal(a.indptr, b.indptr) and np.array_equal(a.indices, b.indices)


@njit(cache=True)
def _places(
    indptr: Int32Array, indices: Int32Array, union_indptr: Int32Array, union_indices: Int32Array
) -> Int32Array:
    """Where each entry of a matrix stands in the union; rows of both are sorted."""
    out = np.empty(len(indices), dtype=np.int32)
    for row in range(len(indptr) - 1):
        at = union_indptr[row]
        for k in range(indptr[row], indptr[row + 1]):
            while union_indices[at] != indices[k]:
                at += 1
            out[k] = at
    return out


@njit(cache=True)
def _add_at(data: Array, places: Int32Array, values: Array) -> None:
    for k in range(len(values)):
        data[places[k]] += values[k]
