"""Base of the potentials that act on points embedded in a mesh, each a sum of energies of single points."""

from __future__ import annotations

import copy
from typing import Self

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import ArrayLike

from handpipe.core import Array, BoolArray, InputError, Int32Array, IntArray
from handpipe.fem.patterns.assembly import Pattern


class PointPotential:
    """Base of energies sum_c psi_c(p_c) of points p = W x.

    A subclass gives `energies`, `forces` and `stiffnesses` of points (k, 3).

    Parameters
    ----------
    operator : sparse matrix (k, n)
        W, which takes vertex positions (n, 3) to points (k, 3).
    """

    quadratic = False  # whether the Hessian does not depend on x
    each: tuple[str, ...] | None = None  # names of the arrays with a row a point; None: points are not chosen

    def __init__(self, operator: sp.spmatrix | sp.sparray) -> None:
        self.operator = sp.csr_matrix(operator)
        self.operator.sum_duplicates()
        self._pattern: Pattern | None = None
        self._hessian: sp.csr_matrix | None = None  # of a quadratic energy

    def energies(self, points: Array) -> Array:
        """Energy (k,) of each point."""
        raise NotImplementedError

    def forces(self, points: Array) -> Array:
        """Gradient (k, 3) of each point's energy."""
        raise NotImplementedError

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (k, 3, 3) of each point's energy."""
        raise NotImplementedError

    def twin(self) -> Self:
        """A copy that shares the pattern of the Hessian."""
        _ = self.pattern
        return copy.copy(self)

    @property
    def count(self) -> int:
        """Number of points."""
        return self.operator.shape[0]

    @property
    def pattern(self) -> Pattern:
        """Pattern of the Hessian, found at the first call; copies of a potential share it."""
        if self._pattern is None:
            w = self.operator
            starts, members = w.indptr.astype(np.int64), w.indices.astype(np.int64)
            self._pattern = Pattern.of_ragged(starts, members, w.shape[1])
        return self._pattern

    def points(self, x: Array) -> Array:
        """Positions (k, 3) of the points."""
        return self.operator @ x

    def value(self, x: Array) -> float:
        """Energy in microjoules, summed over the points."""
        return float(self.energies(self.points(x)).sum())

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: W^T times the points' `forces`."""
        return self.operator.T @ self.forces(self.points(x))

    def force_sizes(self, x: Array) -> Array:
        """Sum (n,) of the sizes in mN of the forces that points put on each vertex."""
        return abs(self.operator).T @ np.sqrt((self.forces(self.points(x)) ** 2).sum(axis=1))

    def reached(self) -> BoolArray:
        """Mask (n,) of the vertices that carry points."""
        return np.bincount(self.operator.indices, minlength=self.operator.shape[1]) > 0

    def near(self, moving: BoolArray, kept: IntArray) -> Self | None:
        """The energy of the points that the vertices of a mask (n,) carry, as `Sum.near` says."""
        if self.each is None:
            return None
        carried = np.flatnonzero(abs(self.operator) @ moving.astype(float))
        return self._chosen(carried, self.operator[carried][:, kept])

    def _chosen(self, ids: IntArray, operator: sp.csr_matrix) -> Self:
        """The energy of some of the points, by their indices (k,), carried by other vertices."""
        other = copy.copy(self)
        other.operator, other._pattern, other._hessian = operator, None, None
        for name in self.each or ():
            setattr(other, name, getattr(self, name)[ids])
        return other

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm; with `project`, of projected `stiffnesses`.

        That of a quadratic energy is the same matrix at each call.
        """
        if not self.quadratic:
            return self._assembled(x, project)
        if self._hessian is None:
            self._hessian = self._assembled(x, project)
        return self._hessian

    def _assembled(self, x: Array, project: bool) -> sp.csr_matrix:
        w, pattern = self.operator, self.pattern
        data = pattern.data()
        blocks = np.ascontiguousarray(self.stiffnesses(self.points(x), project))
        _scatter(w.indptr, w.indices, w.data, blocks, pattern.slots, pattern.strides, data)
        return pattern.matrix(data)


def per_point(value: ArrayLike, count: int, name: str) -> Array:
    """One value a point, of a number for all or an array.

    Parameters
    ----------
    value : float or array (k,)
        Values of zero or more, in any unit.
    count : int
        Number k of points.
    name : str
        Name of the values in errors.

    Returns
    -------
    array (k,)
        A copy of the values in the same unit.

    Raises
    ------
    InputError
        If an array has another shape, or a value is negative or not finite.
    """
    array = np.asarray(value, dtype=float)
    if array.ndim > 0 and array.shape != (count,):
        raise InputError(
            "constraint", name, f"has shape {array.shape} for {count} points", "Give one a point"
        )
    if np.any(array < 0) or not np.all(np.isfinite(array)):
        raise InputError("constraint", name, "is negative or not finite", "Use values of zero or more")
    return np.broadcast_to(array, (count,)).copy()


@njit(cache=True)
def _scatter(
    indptr: Int32Array,
    indices: Int32Array,
    weights: Array,
    blocks: Array,
    slots: Int32Array,
    strides: Int32Array,
    data: Array,
) -> None:
    at = 0
    for c in range(len(indptr) - 1):
        members = indptr[c + 1] - indptr[c]
        if not blocks[c].any():  # most points of one-sided contact are free
            at += members * members
            continue
        for p in range(indptr[c], indptr[c + 1]):
            stride = strides[indices[p]]
            for q in range(indptr[c], indptr[c + 1]):
                scale = weights[p] * weights[q]
                for i in range(3):
                    for j in range(3):
                        data[slots[at] + i * stride + j] += scale * blocks[c, i, j]
                at += 1


def dyads(vectors: Array) -> Array:
    """Outer products (k, 3, 3) of vectors (k, 3) with themselves."""
    return vectors[:, :, None] * vectors[:, None, :]
