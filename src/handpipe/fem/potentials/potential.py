"""What every physical effect is: a potential energy of vertex positions, with gradient and Hessian."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp
from numba import get_num_threads, njit, prange

from handpipe.core import Array, BoolArray, Int32Array, IntArray
from handpipe.fem.patterns.buffers import Buffers

PARALLEL_ENTRIES = 1_000_000  # of a matrix; fewer are moved sooner than a thread is woken


@runtime_checkable
class Potential(Protocol):
    """An energy of positions x (n, 3) in mm. Degree of freedom of vertex i, coordinate c is 3 i + c.

    A potential may also offer `max_step(x, step) -> float`, the largest fraction in (0, 1] of a displacement
    that it allows, and `refresh(x) -> None`, called between Newton steps, where it may update what it keeps
    constant within a step. With `near(moving, kept) -> Potential | None` it gives what depends on a few
    vertices (see `Sum.near`).
    """

    def value(self, x: Array) -> float:
        """Energy in microjoules."""
        ...

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force."""
        ...

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm; with `project`, a positive semidefinite substitute."""
        ...


class Sum:
    """Sum of potentials.

    The union of their Hessians' patterns is kept as long as these patterns stay the same.

    Parameters
    ----------
    potentials : sequence of Potential
        Potentials of the same vertices.
    """

    def __init__(self, potentials: Sequence[Potential]) -> None:
        self.potentials = list(potentials)
        self._parts: list[sp.csr_matrix] = []
        self._indptr = self._indices = np.zeros(0, dtype=np.int32)
        self._places: list[Int32Array] = []
        self._order: list[int] = []  # largest first: where it has the union's pattern, it is copied
        self._buffers = Buffers()

    def value(self, x: Array) -> float:
        """Energy in microjoules, summed over the potentials."""
        return float(sum(p.value(x) for p in self.potentials))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN, summed over the potentials."""
        total = np.zeros_like(x)
        for potential in self.potentials:
            total += potential.gradient(x)
        return total

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm; with `project`, the sum of semidefinite substitutes."""
        matrices = [p.hessian(x, project) for p in self.potentials]
        if len(matrices) == 1:
            return matrices[0]
        if not self._same_patterns(matrices):
            self._merge(matrices)
        data = self._buffers.take(len(self._indices))
        for number in self._order:
            matrix, places = matrices[number], self._places[number]
            add_rows(data, self._indptr, matrix.indptr, places, matrix.data, number == self._order[0])
        return canonical(data, self._indices, self._indptr, matrices[0].shape)

    def near(self, moving: BoolArray, kept: IntArray) -> Sum | None:
        """The energy that changes when only a few vertices move: all else is constant then.

        Parameters
        ----------
        moving : boolean array (n,)
            Mask of these vertices.
        kept : integer array (k,)
            Their indices and those of all vertices that share an element with them, ascending: the vertices
            of the result.

        Returns
        -------
        Sum or None
            None where a potential cannot be cut.
        """
        parts: list[Potential] = []
        for potential in self.potentials:
            part = potential.near(moving, kept) if hasattr(potential, "near") else None
            if part is None:
                return None
            parts.append(part)
        return Sum(parts)

    def max_step(self, x: Array, step: Array) -> float:
        """Largest fraction in (0, 1] of the displacement that every potential allows."""
        limits = [p.max_step(x, step) for p in self.potentials if hasattr(p, "max_step")]
        return min([1.0, *limits])

    def refresh(self, x: Array) -> None:
        """Refresh every potential that offers `refresh`."""
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
        self._order = sorted(range(len(matrices)), key=lambda i: -matrices[i].nnz)
        self._parts = [pattern_of(m) for m in matrices]


def canonical(data: Array, indices: Int32Array, indptr: Int32Array, shape: tuple[int, int]) -> sp.csr_matrix:
    """CSR matrix of arrays that are known to be sorted and without duplicates."""
    matrix = sp.csr_matrix((data, indices, indptr), shape=shape, copy=False)
    matrix.has_sorted_indices = matrix.has_canonical_format = True
    return matrix


def pattern_of(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """A matrix that shares the index arrays and keeps none of the values alive."""
    values = np.broadcast_to(0.0, len(matrix.indices))
    return canonical(values, matrix.indices, matrix.indptr, matrix.shape)


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


def add_rows(
    data: Array, union_indptr: Int32Array, indptr: Int32Array, places: Int32Array, values: Array, first: bool
) -> None:
    """Add a matrix's values to the union's `data`, of which the `first` need not be zeroed before."""
    if len(values) < PARALLEL_ENTRIES:
        _add_rows(data, union_indptr, indptr, places, values, first, (0, len(indptr) - 1))
    else:
        _add_rows_parallel(data, union_indptr, indptr, places, values, first, get_num_threads())


@njit(cache=True)
def _add_rows(
    data: Array,
    union_indptr: Int32Array,
    indptr: Int32Array,
    places: Int32Array,
    values: Array,
    first: bool,
    rows: tuple[int, int],
) -> None:
    low, high = rows
    if first:
        if len(values) == len(data):
            for k in range(indptr[low], indptr[high]):
                data[k] = values[k]
            return
        for k in range(union_indptr[low], union_indptr[high]):
            data[k] = 0.0
    for k in range(indptr[low], indptr[high]):
        data[places[k]] += values[k]


@njit(cache=True, parallel=True)
def _add_rows_parallel(
    data: Array,
    union_indptr: Int32Array,
    indptr: Int32Array,
    places: Int32Array,
    values: Array,
    first: bool,
    parts: int,
) -> None:
    rows = len(indptr) - 1
    for part in prange(parts):
        low, high = rows * part // parts, rows * (part + 1) // parts
        _add_rows(data, union_indptr, indptr, places, values, first, (low, high))
