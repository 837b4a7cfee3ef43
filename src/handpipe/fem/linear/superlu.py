"""Factorisation by scipy's SuperLU: slow, but present wherever scipy is."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from handpipe.core import Array
from handpipe.fem.linear.factor import FactorTooLarge, NotPositiveDefinite, SingularMatrix, Work, check_memory

LARGEST = 40_000  # unknowns: multigrid is faster beyond (SuperLU took 256 s for 136,000)
# Entries of L for N unknowns of a solid, k N^(4/3), and the bytes that SuperLU takes for each.
ENTRIES, BYTES = 50.0, 24.0
BALANCE = 20.0  # flops in the time of an iteration, per entry of L: see Work


class SuperLUFactor:
    """Minimum degree in symmetric mode for positive definite matrices, partial pivoting for others."""

    def __init__(
        self,
        matrix: sp.csr_matrix | None = None,
        positive: bool = True,
        memory_limit: float = float("inf"),
    ) -> None:
        """Raises as `linear.factorise`; memory is only estimated, since SuperLU has no prediction.

        Under any finite limit, more than `LARGEST` unknowns are too large as well. Without a matrix,
        `refactorise` takes the first one.
        """
        self._positive, self._limit = positive, memory_limit
        if matrix is not None:
            self.refactorise(matrix)

    def refactorise(self, matrix: sp.csr_matrix) -> None:
        """Factorise another matrix; SuperLU repeats the analysis for each matrix."""
        if matrix.shape[0] > LARGEST and self._limit < float("inf"):
            raise FactorTooLarge(f"{matrix.shape[0]} unknowns are too slow for SuperLU")
        estimated = ENTRIES * matrix.shape[0] ** (4 / 3)
        check_memory(Work(0.0, estimated, BYTES * estimated, BALANCE), self._limit)
        options = {"SymmetricMode": True} if self._positive else {}
        threshold = 0.0 if self._positive else 1.0
        order = "MMD_AT_PLUS_A" if self._positive else "COLAMD"
        try:
            self._lu = spla.splu(
                matrix.tocsc(), permc_spec=order, diag_pivot_thresh=threshold, options=options
            )
        except RuntimeError as error:
            if self._positive:
                raise NotPositiveDefinite("the matrix is singular") from error
            raise SingularMatrix(str(error)) from error
        if self._positive:
            pivots = self._lu.U.diagonal()
            # Without row exchanges U is D L^T, whose diagonal has the signs of the eigenvalues.
            if np.any(pivots <= 0) or not np.array_equal(self._lu.perm_r, self._lu.perm_c):
                raise NotPositiveDefinite("the matrix is not positive definite")
        columns = np.diff(self._lu.L.indptr).astype(float)
        entries = float(self._lu.nnz)
        self.work = Work(2.0 * float(columns @ columns), entries / 2, 12.0 * entries, BALANCE)

    def solve(self, b: Array) -> Array:
        """Solution of A x = b, for b (N,) or (N, k)."""
        return self._lu.solve(np.asarray(b, dtype=float))
