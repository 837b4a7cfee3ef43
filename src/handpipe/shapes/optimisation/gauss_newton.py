"""Gauss-Newton steps over the strains of all tets (Wang 2021 Eq. 5.8), by rows or by iteration.

With residuals r of the marks, Z their derivative by the log-strains S and E that by the unknowns q that marks
alone determine (the six means of S and unconstrained rigid motions), a step minimises over T = S + d

    |L T|^2 / 2 + q D q / 2 + |r + Z d + E q|^2 / 2

where D is tiny and only decides what the data do not determine. `by_rows` is the Woodbury identity of Wang
2021 Eq. 5.14, whose small system has one unknown a row (`row_system.py`); constant strains are further
unknowns, in place of the dyads of Wang 2021 Eq. 5.13. `by_iteration` needs products with Z and Z^T alone,
each a solve with the stiffness and one with L: conjugate gradients on the normal equations, in the variables
L T. Its cost is linear in the rows.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from handpipe.core import Array
from handpipe.shapes.optimisation.response import Response
from handpipe.shapes.optimisation.row_system import NearRows, positive_solve, solve_rows
from handpipe.shapes.optimisation.strain_space import NOTHING, Step
from handpipe.shapes.strains.smoothness import Smoothness
from handpipe.shapes.strains.stretch import COUNTS

log = logging.getLogger(__name__)

RIDGE = 1e-5 * COUNTS  # on the means of log-strains
LOOSE_RIDGE = 1e-12  # on rigid motions, of the marks' own stiffness against them
BLOCK = 128  # right-hand sides at a time
ROWS = 1500  # up to which `by_rows` is the quicker one: benchmarks/shapes/solves.py
EXACT = 1e-5  # of the rows' residual, at which they are solved
TOLERANCE = 1e-2  # of the gradient, at which the iteration ends
MOST = 200  # iterations


@dataclass(frozen=True)
class MarkRows:
    """Weighted residuals (k,) of the marks, linear in the positions: matrix (k, 3n)."""

    matrix: sp.csr_matrix
    residuals: Array


class GaussNewton:
    """The quadratic model of one step, from strains `logs` (m, 6) at which the rows are linearised."""

    def __init__(self, smoothness: Smoothness, response: Response, rows: MarkRows, logs: Array) -> None:
        self.smoothness, self.response, self.rows, self.logs = smoothness, response, rows, logs
        self.mean = logs.mean(axis=0)
        uniform = rows.matrix @ response.uniform()
        loose = rows.matrix @ response.loose
        self.free = np.hstack([uniform, loose])
        own = LOOSE_RIDGE * np.maximum((loose**2).sum(axis=0), 1e-300)
        self.ridge = np.concatenate([RIDGE, own])

    def solve(self) -> Step:
        """By rows where they are few, else by iteration."""
        return self.by_rows() if len(self.rows.residuals) <= ROWS else self.by_iteration()

    def uniform(self) -> Step:
        """The step over uniform changes of strain and loose motions alone."""
        wanted = -self.rows.residuals + self.free[:, :6] @ self.mean
        found = positive_solve(self.free.T @ self.free + np.diag(self.ridge), self.free.T @ wanted)
        change = np.broadcast_to(found[:6] - self.mean, self.logs.shape)
        return self._step(np.ascontiguousarray(change), found[6:], 0)

    def by_rows(self, reactions: Array | None = None, tolerance: float = EXACT) -> Step:
        """The Woodbury identity: a system with as many unknowns as rows."""
        reactions = self.reactions() if reactions is None else reactions

        def strains(multipliers: Array) -> Array:
            pulled = (self.response.pulls @ (reactions @ multipliers)).reshape(-1, 6)
            return self.smoothness.inverse(self.smoothness.inverse(pulled)) / COUNTS

        def product(multipliers: Array) -> Array:
            return reactions.T @ (self.response.forces @ strains(multipliers).ravel())

        coarse = self.smoothness.coarse.gram(self.response.pulls, reactions)
        near = NearRows(coarse, self.free, self.ridge)
        multipliers, found, iterations = solve_rows(product, near, self.wanted(), tolerance, MOST)
        change = strains(multipliers) + found[:6] - self.logs
        return self._step(change, found[6:], iterations)

    def by_iteration(self, tolerance: float = TOLERANCE, most: int = MOST) -> Step:
        """Conjugate gradients until the gradient has fallen by `tolerance`.

        In the variables u = B^1/2 T smoothness is |u|^2 / 2, so that smooth changes come first: however early
        it ends, the step lowers the model.
        """
        project = _Projection(np.vstack([self.free, np.diag(np.sqrt(self.ridge))]))
        count = len(self.rows.residuals)

        def forward(u: Array) -> Array:
            moved = self.rows.matrix @ self.response.motion(self.smoothness.unroot(u))
            return project(np.concatenate([moved, np.zeros(len(self.ridge))]))

        def adjoint(y: Array) -> Array:
            return self.smoothness.unroot(self.response.pull(self.rows.matrix.T @ y[:count]))

        wanted = np.concatenate([self.wanted(), np.zeros(len(self.ridge))])
        start = self.smoothness.root(self.logs)
        u, iterations = damped_least_squares(forward, adjoint, project(wanted), start, tolerance, most)
        strains = self.smoothness.unroot(u)
        wanted[:count] -= self.rows.matrix @ self.response.motion(strains)
        found = project.coefficients(wanted)
        return self._step(strains + found[:6] - self.logs, found[6:], iterations)

    def wanted(self) -> Array:
        """What Z T + E q should be: Z S - r."""
        return self.rows.matrix @ self.response.motion(self.logs) - self.rows.residuals

    def reactions(self) -> Array:
        """-K^-1 A^T (3n, k) of all rows, which is most of Z."""
        count = len(self.rows.residuals)
        blocks = [self.response.reactions(self.rows.matrix[at : at + BLOCK]) for at in range(0, count, BLOCK)]
        return np.hstack(blocks)

    def gram(self, reactions: Array) -> Array:
        """Z B^+ Z^T (k, k), its lower triangle, one of the six numbers after the other."""
        count = reactions.shape[1]
        gram = np.zeros((count, count), order="F")
        smooth = np.empty((len(self.logs), count), order="F")
        for number, times in enumerate(COUNTS):
            pulls = self.response.pulls[number::6]
            for at in range(0, count, BLOCK):
                block = np.ascontiguousarray(reactions[:, at : at + BLOCK])
                smooth[:, at : at + BLOCK] = self.smoothness.inverse(pulls @ block)
            gram = scipy.linalg.blas.dsyrk(
                1.0 / times, smooth, beta=1.0, c=gram, trans=1, lower=1, overwrite_c=1
            )
        return gram

    def _step(self, strains: Array, loose: Array, iterations: int) -> Step:
        motion = self.response.motion(strains) + self.response.loose @ loose
        slope = float(np.vdot(self.smoothness.gradient(self.logs), strains))
        slope += float((RIDGE * self.mean) @ strains.mean(axis=0))
        slope += float(self.rows.residuals @ (self.rows.matrix @ motion))
        return Step(strains, motion.reshape(-1, 3), slope, ends=NOTHING, loose=loose, iterations=iterations)


class _Projection:
    """Off the columns of a tall matrix."""

    def __init__(self, columns: Array) -> None:
        self._q, self._r = np.linalg.qr(columns)

    def __call__(self, y: Array) -> Array:
        return y - self._q @ (self._q.T @ y)

    def coefficients(self, y: Array) -> Array:
        """Of the columns, in the best approximation of y."""
        return scipy.linalg.solve_triangular(self._r, self._q.T @ y)


def damped_least_squares(
    forward: Callable[[Array], Array],
    adjoint: Callable[[Array], Array],
    wanted: Array,
    start: Array,
    tolerance: float,
    most: int,
) -> tuple[Array, int]:
    """Minimiser u of |u|^2 + |M u - wanted|^2 from a start, and the iterations (CGLS; Bjorck 1996, 7.4).

    forward: M; adjoint: its transpose. Ends where the gradient has fallen by `tolerance` from the start.
    """
    u = start.copy()
    residual = wanted - forward(u)
    gradient = adjoint(residual) - u
    size = float(np.vdot(gradient, gradient))
    limit = tolerance**2 * max(size, 1e-300)
    direction = gradient
    for iteration in range(most):
        if size <= limit:
            return u, iteration
        moved = forward(direction)
        length = size / float(np.vdot(moved, moved) + np.vdot(direction, direction))
        u += length * direction
        residual -= length * moved
        gradient = adjoint(residual) - u
        size, before = float(np.vdot(gradient, gradient)), size
        direction = gradient + (size / before) * direction
    log.info("gradient fell to %.1e of the start in %d iterations", (size / limit) ** 0.5 * tolerance, most)
    return u, most
