"""Whether the forces of a state balance, judged vertex by vertex.

With a single scale for all vertices, one stiff spring, or one contact that nearly touches, would decide which
force is small everywhere else. Here the unbalanced force on a vertex is compared with the forces on that
vertex alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numba import njit
from scipy.sparse.csgraph import connected_components

from handpipe.core import Array, Int32Array, IntArray
from handpipe.fem.minimisation.spacing import spacing
from handpipe.fem.potentials.potential import Potential, Sum

SMALL_STRAIN = 1e-3  # strain whose forces are the least that a vertex is measured by
ROUNDINGS = 16.0  # errors of a unit in the last place that a sum of a vertex's forces may gather


class Balance:
    """Limit below which a force on a vertex is small, for one energy and a relative tolerance.

    The limit is a share of the largest of: the forces that tets and other elements put on the vertex; those
    of springs, contact and loads; and the force of a small strain there, for bodies that come to rest without
    any force. The last is not taken above the largest constant load on the same connected part, since a load
    may be small against the stiffness of what carries it.
    """

    def __init__(self, energy: Sum, stiffness: sp.csr_matrix, x: Array, tolerance: float) -> None:
        """Limits from `stiffness` (3n, 3n), the plain Hessian at x (n, 3)."""
        self.energy, self.tolerance = energy, tolerance
        self.resistance = _resistance(energy, stiffness, x)
        self.least = SMALL_STRAIN * self.resistance
        load = loads(energy, x)
        if load is not None:
            parts = vertex_parts(stiffness)
            largest = np.zeros(int(parts.max()) + 1)
            np.maximum.at(largest, parts, lengths(load))
            self.least = np.minimum(self.least, np.where(largest[parts] > 0, largest[parts], np.inf))

    def limits(self, x: Array, gradients: Sequence[Array]) -> Array:
        """Largest force (n,) in mN that counts as none, from each potential's gradient (n, 3) at x."""
        largest = self.least.copy()
        for potential, gradient in zip(self.energy.potentials, gradients, strict=True):
            np.maximum(largest, force_sizes(potential, x, gradient), out=largest)
        return self.tolerance * largest


def force_sizes(potential: Potential, x: Array, gradient: Array) -> Array | float:
    """Sizes (n,) of a potential's forces on vertices where it offers them, else the largest of them."""
    if hasattr(potential, "force_sizes"):
        return np.asarray(potential.force_sizes(x))
    return float(lengths(gradient).max(initial=0.0))


def loads(energy: Sum, x: Array) -> Array | None:
    """Sum of the constant forces (n, 3), or None without any."""
    constant = [p for p in energy.potentials if getattr(p, "constant", False)]
    return -Sum(constant).gradient(x) if constant else None


def rounding(stiffness: sp.csr_matrix, x: Array) -> Array:
    """Force (n,) in mN below which that on a vertex is rounding, for the Hessian (3n, 3n) at x (n, 3).

    Positions are known to a unit in the last place, forces thus to the change that this makes of them.
    """
    sizes = np.abs(np.ascontiguousarray(x)).ravel()
    unit = float(np.finfo(float).eps)
    return ROUNDINGS * unit * _row_sums(stiffness.indptr, stiffness.indices, stiffness.data, sizes)


def vertex_parts(stiffness: sp.csr_matrix) -> IntArray:
    """Number (n,) of the connected part of the matrix (3n, 3n) that each vertex belongs to."""
    count = stiffness.shape[0] // 3
    rows = np.repeat(np.arange(count), np.diff(stiffness.indptr[::3]))
    entries = np.ones(stiffness.nnz, dtype=bool)
    graph = sp.csr_matrix((entries, (rows, stiffness.indices // 3)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def lengths(vectors: Array) -> Array:
    """Norms (n,) of vectors (n, 3) or (3n,)."""
    return np.asarray(np.sqrt((vectors.reshape(-1, 3) ** 2).sum(axis=1)))


def _resistance(energy: Sum, stiffness: sp.csr_matrix, x: Array) -> Array:
    """Force (n,) in mN that strains a vertex's elements by one, roughly.

    Penalties do not count. Where no potential offers its resistance, it is that against a move of the mean
    distance of vertices.
    """
    elastic = [p.resistance() for p in energy.potentials if hasattr(p, "resistance")]
    if elastic:
        return np.asarray(np.sum(elastic, axis=0))
    diagonal = np.abs(stiffness.diagonal()).reshape(-1, 3).mean(axis=1)
    return np.asarray(diagonal * spacing(x))


@njit(cache=True)
def _row_sums(indptr: Int32Array, indices: Int32Array, data: Array, sizes: Array) -> Array:
    """Largest of the sums |H| s of a vertex's three rows (n,)."""
    out = np.zeros((len(indptr) - 1) // 3)
    for row in range(len(indptr) - 1):
        total = 0.0
        for k in range(indptr[row], indptr[row + 1]):
            total += abs(data[k]) * sizes[indices[k]]
        out[row // 3] = max(out[row // 3], total)
    return out
