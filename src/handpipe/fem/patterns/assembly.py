"""Sparsity patterns computed once, and element matrices scattered into them by index.

A cell is a list of vertices whose coordinates are coupled. The pattern is built from 3x3 blocks: block
b of row vertex i, with `starts[i] <= b < starts[i + 1]`, begins at `9 starts[i] + 3 (b - starts[i])` in
the data of the scalar matrix, and the rows below it follow `3 (starts[i + 1] - starts[i])` entries apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numba import njit

from handpipe.core import Array, Int32Array, IntArray
from handpipe.fem.patterns.buffers import Buffers


@dataclass(frozen=True)
class Pattern:
    """Pattern of the Hessian of cells over n vertices, in CSR form with sorted indices.

    Parameters
    ----------
    vertices : int
        Number n of vertices.
    indptr : integer array (3n + 1,)
        Starts of the rows in `indices`.
    indices : integer array (nonzeros,)
        Columns, ascending in each row.
    slots : integer array (sum of k^2 over cells,)
        Where the 3x3 block of each pair of a cell's vertices begins in the data; a cell of k vertices has
        k x k pairs, by rows.
    strides : integer array (n,)
        Distance in the data from one row of a vertex's blocks to the next.
    _buffers : Buffers
        Arrays of values for reuse.
    """

    vertices: int
    indptr: Int32Array
    indices: Int32Array
    slots: Int32Array
    strides: Int32Array
    _buffers: Buffers = field(default_factory=Buffers, repr=False, compare=False)

    @staticmethod
    def of_cells(cells: IntArray, vertices: int) -> Pattern:
        """Pattern of cells (m, k)."""
        starts = np.arange(0, cells.size + 1, cells.shape[1], dtype=np.int64)
        return Pattern.of_ragged(starts, np.ascontiguousarray(cells, dtype=np.int64).ravel(), vertices)

    @staticmethod
    def of_ragged(starts: IntArray, members: IntArray, vertices: int) -> Pattern:
        """Pattern of cells of any size: cell c has the distinct vertices members[starts[c]:starts[c + 1]]."""
        block_starts, block_columns, blocks = _blocks(starts, members, vertices)
        indptr, indices, strides = _scalar_pattern(block_starts, block_columns)
        slots = _slots(starts, members, blocks, block_starts)
        return Pattern(vertices, indptr, indices, slots, strides)

    def data(self) -> Array:
        """Zeroed values."""
        return np.zeros(len(self.indices))

    def uninitialised(self) -> Array:
        """Values to be overwritten: an earlier array if nobody references it any more, else a new one.

        New large arrays cost more than filling them, since the system maps and clears their pages.
        """
        return self._buffers.take(len(self.indices))

    def matrix(self, data: Array) -> sp.csr_matrix:
        """Values as a matrix (3n, 3n); all matrices of a pattern share its index arrays."""
        size = 3 * self.vertices
        matrix = sp.csr_matrix((data, self.indices, self.indptr), shape=(size, size), copy=False)
        matrix.has_sorted_indices = matrix.has_canonical_format = True
        return matrix


@njit(cache=True)
def _incidence(starts: IntArray, members: IntArray, vertices: int) -> tuple[IntArray, IntArray]:
    """For each vertex the positions in `members` where it stands: their starts and the positions."""
    counts = np.zeros(vertices + 1, dtype=np.int64)
    for v in members:
        counts[v + 1] += 1
    first = np.cumsum(counts)
    fill = first.copy()
    positions = np.empty(len(members), dtype=np.int64)
    for p in range(len(members)):
        v = members[p]
        positions[fill[v]] = p
        fill[v] += 1
    return first, positions


@njit(cache=True)
def _blocks(starts: IntArray, members: IntArray, vertices: int) -> tuple[IntArray, IntArray, IntArray]:
    """Block CSR (starts, sorted columns) and the block of each cell's vertex pair; has every diagonal."""
    first, positions = _incidence(starts, members, vertices)
    cell_of = np.empty(len(members), dtype=np.int64)
    pair_starts = np.zeros(len(starts), dtype=np.int64)
    for c in range(len(starts) - 1):
        size = starts[c + 1] - starts[c]
        pair_starts[c + 1] = pair_starts[c] + size * size
        cell_of[starts[c] : starts[c + 1]] = c
    blocks = np.empty(pair_starts[-1], dtype=np.int64)
    block_starts = np.zeros(vertices + 1, dtype=np.int64)
    columns = np.empty(pair_starts[-1] + vertices, dtype=np.int64)
    seen = np.full(vertices, -1, dtype=np.int64)
    place = np.empty(vertices, dtype=np.int64)
    count = 0
    for v in range(vertices):
        begin = count
        seen[v] = v
        columns[count] = v
        count += 1
        for p in positions[first[v] : first[v + 1]]:
            c = cell_of[p]
            for w in members[starts[c] : starts[c + 1]]:
                if seen[w] != v:
                    seen[w] = v
                    columns[count] = w
                    count += 1
        columns[begin:count] = np.sort(columns[begin:count])
        for b in range(begin, count):
            place[columns[b]] = b
        for p in positions[first[v] : first[v + 1]]:
            c = cell_of[p]
            size = starts[c + 1] - starts[c]
            row = pair_starts[c] + (p - starts[c]) * size
            for q in range(size):
                blocks[row + q] = place[members[starts[c] + q]]
        block_starts[v + 1] = count
    return block_starts, columns[:count].copy(), blocks


@njit(cache=True)
def _scalar_pattern(starts: IntArray, columns: IntArray) -> tuple[Int32Array, Int32Array, Int32Array]:
    n = len(starts) - 1
    indptr = np.empty(3 * n + 1, dtype=np.int32)
    indices = np.empty(9 * len(columns), dtype=np.int32)
    strides = np.empty(n, dtype=np.int32)
    at = 0
    indptr[0] = 0
    for v in range(n):
        strides[v] = 3 * (starts[v + 1] - starts[v])
        for c in range(3):
            for b in range(starts[v], starts[v + 1]):
                for d in range(3):
                    indices[at] = 3 * columns[b] + d
                    at += 1
            indptr[3 * v + c + 1] = at
    return indptr, indices, strides


@njit(cache=True)
def _slots(starts: IntArray, members: IntArray, blocks: IntArray, block_starts: IntArray) -> Int32Array:
    slots = np.empty(len(blocks), dtype=np.int32)
    at = 0
    for c in range(len(starts) - 1):
        size = starts[c + 1] - starts[c]
        for p in range(size):
            begin = block_starts[members[starts[c] + p]]
            for _ in range(size):
                slots[at] = 9 * begin + 3 * (blocks[at] - begin)
                at += 1
    return slots
