"""Newton directions: of the plain Hessian where it is positive definite, else of a convex substitute."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray
from handpipe.fem.linear.factorisation import NotPositiveDefinite, SingularMatrix
from handpipe.fem.minimisation.record import Record
from handpipe.fem.minimisation.workspace import Workspace
from handpipe.fem.potentials.potential import Sum

Result = TypeVar("Result")

LEAST_BLEND = 1 / 16  # smaller shares of the projected Hessian are not tried
SHIFTS = (0.0, 1e-8, 1e-5, 1e-2, 1.0)  # of the mean diagonal


class Directions:
    """Directions for one energy and one set of unknowns.

    `convexified` is True where the last Hessian was not positive definite.
    """

    def __init__(self, energy: Sum, free: BoolArray, workspace: Workspace, record: Record) -> None:
        self.energy, self.free, self.workspace, self.record = energy, free, workspace, record
        self.convexified = False
        self._share = 0.0

    def at(self, x: Array, gradient: Array, tolerance: float, anew: bool = False) -> Array | None:
        """Descent direction (3n,) for the gradient (3n,) at x; None where nothing can be factorised.

        Where the plain Hessian was not positive definite, the next call tries it again only with `anew`.
        """
        plain = self._timed("assembly", lambda: self.stiffness(x))
        force = -gradient[self.free]
        solution = None
        if anew or self._share < LEAST_BLEND:
            solution = self._solve(plain, force, tolerance)
        self.convexified = solution is None
        if solution is None:
            self.record.projections += 1
            projected = self._timed("assembly", lambda: self.stiffness(x, project=True))
            solution = self._by_blend(plain, projected, force, tolerance)
        if solution is None:
            return None
        direction = np.zeros(x.size)
        direction[self.free] = solution
        return direction

    def stiffness(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Hessian (N, N) of the unknowns at x."""
        matrix = self.energy.hessian(x, True) if project else self.tangent(x)
        return self.workspace.block(matrix, self.free)

    def tangent(self, x: Array) -> sp.csr_matrix:
        """Plain Hessian (3n, 3n) at x, kept for a second use."""
        matrix = self.workspace.tangent(self.energy, x, 0.0)
        if matrix is None:
            matrix = self.energy.hessian(x)
            self.workspace.keep(self.energy, x, matrix)
        return matrix

    def _by_blend(
        self, plain: sp.csr_matrix, projected: sp.csr_matrix, force: Array, tolerance: float
    ) -> Array | None:
        """Solution with a share of the projected Hessian, near the smallest that worked so far.

        The projected Hessian alone is far too stiff near a saddle: steps become tiny. It is tried first,
        though, since smaller shares seldom help at first and each costs a factorisation. After a share that
        worked a quarter of it is tried, after one that failed four times as much.
        """
        share = self._share if self._share >= LEAST_BLEND else 1.0
        while share < 1.0:
            mixed = plain.copy()
            mixed.data += share * (projected.data - plain.data)
            solution = self._solve(mixed, force, tolerance)
            if solution is not None:
                self._share = 0.25 * share
                return solution
            share *= 4.0
        self._share = 0.25
        return self._by_shift(projected, force, tolerance)

    def _by_shift(self, matrix: sp.csr_matrix, force: Array, tolerance: float) -> Array | None:
        """Solution with the least of a few growing multiples of the identity that makes it possible."""
        mean = _mean_diagonal(matrix)
        for shift in SHIFTS:
            shifted = matrix if shift == 0.0 else _add_diagonal(matrix, shift * mean)
            solution = self._solve(shifted, force, tolerance)
            if solution is not None and np.all(np.isfinite(solution)):
                return solution
        return None

    def _solve(self, matrix: sp.csr_matrix, force: Array, tolerance: float) -> Array | None:
        """Solution, or None where the matrix is not positive definite."""

        def work() -> Array:
            return self.workspace.systems.solve(matrix, force, tolerance=tolerance, free=self.free)

        try:
            return self._timed("linear", work)
        except (NotPositiveDefinite, SingularMatrix):
            return None

    def _timed(self, kind: str, work: Callable[[], Result]) -> Result:
        start = time.perf_counter()
        try:
            return work()
        finally:
            self.record.seconds[kind] += time.perf_counter() - start


def _mean_diagonal(matrix: sp.csr_matrix) -> float:
    return float(np.abs(matrix.diagonal()).mean())


def _add_diagonal(matrix: sp.csr_matrix, shift: float) -> sp.csr_matrix:
    """Matrix plus a multiple of the identity, in the same pattern (which contains the diagonal)."""
    shifted = matrix.copy()
    shifted.setdiag(matrix.diagonal() + shift)
    return shifted
