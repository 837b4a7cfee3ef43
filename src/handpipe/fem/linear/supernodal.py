"""Factorisation by rslab (MIT), a supernodal LDL^T in Rust, for machines without MKL."""

from __future__ import annotations

import contextlib
import importlib
import os
from typing import Any

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array
from handpipe.fem.linear.factor import MatrixPattern, NotPositiveDefinite, SingularMatrix, Work, check_memory

BALANCE = 36.0  # flops in the time of an iteration, per entry of L: see Work

rslab: Any = None
with contextlib.suppress(ImportError):
    rslab = importlib.import_module("rslab")


def available() -> bool:
    """Whether rslab is installed."""
    return rslab is not None


class SupernodalFactor:
    """Bunch-Kaufman LDL^T, nested dissection; its bits do not depend on the number of threads.

    OMP_NUM_THREADS sets the number of threads.
    """

    def __init__(
        self,
        matrix: sp.csr_matrix | None = None,
        positive: bool = True,
        memory_limit: float = float("inf"),
    ) -> None:
        """Raises as `linear.factorise`. Without a matrix, `refactorise` takes the first one."""
        self.work = Work(0.0, 0.0, 0.0, BALANCE)
        self._positive, self._limit = positive, memory_limit
        self._threads = int(os.environ.get("OMP_NUM_THREADS") or os.cpu_count() or 1)
        self._pattern: MatrixPattern | None = None
        self._factor: Any = None
        if matrix is not None:
            self.refactorise(matrix)

    def refactorise(self, matrix: sp.csr_matrix) -> None:
        """Factorise another matrix, reusing the symbolic analysis where the pattern is the same."""
        matrix.sort_indices()
        self._factor = None  # two factors at a time would take twice the memory
        if self._pattern is None or not self._pattern.fits(matrix):
            self._analyse(matrix)
        try:
            self._factor = self._symbolic.factor(_lower_values(matrix), threads=self._threads)
        except RuntimeError as error:
            if self._positive:
                raise NotPositiveDefinite(f"the matrix is not positive definite: {error}") from error
            raise SingularMatrix(f"{matrix.shape[0]} unknowns: {error}") from error
        if self._positive and self._factor.inertia[0] < matrix.shape[0]:
            self._factor = None
            raise NotPositiveDefinite("the matrix is not positive definite")

    def solve(self, b: Array) -> Array:
        """Solution of A x = b, for b (N,) or (N, k)."""
        right = np.ascontiguousarray(b, dtype=float)
        return self._factor.solve(right) if right.ndim == 1 else self._factor.solve_many(right)

    def _analyse(self, matrix: sp.csr_matrix) -> None:
        self._pattern = None
        self._symbolic = rslab.analyze(matrix.tocsc(), path="ldlt", ordering="metis", threads=self._threads)
        self.work = Work(
            flops=float(self._symbolic.estimate_memory()["factor_flops"]),
            entries=float(self._symbolic.factor_nnz),
            bytes=float(self._symbolic.memory_plan()["peak_bytes"]),
            balance=BALANCE,
        )
        check_memory(self.work, self._limit)
        self._pattern = MatrixPattern(matrix)


def _lower_values(matrix: sp.csr_matrix) -> Array:
    """Values of the lower triangle by columns: by symmetry, those of the upper by rows."""
    return sp.triu(matrix, format="csr").data
