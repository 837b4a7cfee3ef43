"""The system of the Woodbury identity, one unknown a row (Wang 2021 Eq. 5.14), by conjugate gradients.

    (G + 1) y + E q = w,   E^T y = D q,

with G = Z B^+ Z^T, available by products only, and E the derivative by the constants and the unconstrained
rigid motions, q. To form G takes six solves with L a row, a product with it twelve; with a coarse G, which
takes none, few products are needed. Every iterate satisfies the second equation exactly (Gould, Hribar and
Nocedal 2001), for D is so small that it must not be eliminated.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
import scipy.linalg

from handpipe.core import Array

log = logging.getLogger(__name__)

ROUNDING = 1e-13  # of the trace of a small system


class NearRows:
    """The same system with a coarse G, solved directly."""

    def __init__(self, gram: Array, free: Array, ridge: Array) -> None:
        """Factor of the system with the coarse G.

        `gram` (k, k) is the lower triangle of G, and is overwritten; `free` is E (k, r); `ridge` is the
        diagonal (r,) of D.
        """
        gram[np.diag_indices_from(gram)] += 1.0
        self.free, self.ridge = free, ridge
        self._factor = scipy.linalg.cho_factor(gram, lower=True, overwrite_a=True, check_finite=False)
        self._spread = scipy.linalg.cho_solve(self._factor, free, check_finite=False)
        self._schur = free.T @ self._spread + np.diag(ridge)

    def solve(self, wanted: Array) -> tuple[Array, Array]:
        """Solution y (k,) and q (r,) for w (k,)."""
        found = scipy.linalg.cho_solve(self._factor, wanted, check_finite=False)
        q = positive_solve(self._schur, self.free.T @ found)
        return found - self._spread @ q, q


def solve_rows(
    product: Callable[[Array], Array], near: NearRows, wanted: Array, tolerance: float, most: int
) -> tuple[Array, Array, int]:
    """Solution y (k,), q (r,) and the iterations that it took; product: G times (k,).

    Ends where the residual has fallen by `tolerance` in the norm of the inverse of the coarse system.
    """
    y, q, residual = np.zeros_like(wanted), np.zeros_like(near.ridge), wanted.copy()
    along, along_free = near.solve(residual)
    size = float(residual @ along)
    limit = tolerance**2 * size
    for iteration in range(most):
        if size <= limit:
            return y, q, iteration
        moved = product(along) + along
        length = size / float(along @ moved + along_free @ (near.ridge * along_free))
        y += length * along
        q += length * along_free
        residual -= length * (moved + near.free @ along_free)
        step, step_free = near.solve(residual)
        size, before = float(residual @ step), size
        along = step + (size / before) * along
        along_free = step_free + (size / before) * along_free
    log.info("rows: fell to %.1e of the start in %d iterations", tolerance * (size / limit) ** 0.5, most)
    return y, q, most


def positive_solve(matrix: Array, b: Array) -> Array:
    """Solution with a small symmetric matrix of which only rounding may have spoilt the positive sign."""
    shift = ROUNDING * float(np.trace(matrix))
    return np.asarray(np.linalg.solve(matrix + shift * np.eye(len(matrix)), b))
