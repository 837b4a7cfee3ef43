"""Interface of factorised symmetric matrices of any library, and the errors of factorisations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, HandpipeError


class NotPositiveDefinite(HandpipeError):
    """A matrix that was to be positive definite is not."""


class SingularMatrix(HandpipeError):
    """A matrix could not be factorised, or a system not solved."""


class FactorTooLarge(HandpipeError):
    """The factor would need more memory than allowed."""


@dataclass(frozen=True)
class Work:
    """Predictions of the symbolic analysis, the same in every run.

    `flops` of a factorisation and `entries` of the factor as the library counts them, peak memory in bytes,
    and the library's `balance`: the flops that it does in a factorisation while an iteration of conjugate
    gradients, mostly a solve, deals with one entry. It is measured by benchmarks/fem/linear.py; a faster
    machine or a second thread speeds up both sides much alike.
    """

    flops: float
    entries: float
    bytes: float
    balance: float

    @property
    def price(self) -> float:
        """Cost of a factorisation in iterations of conjugate gradients with the factor."""
        return self.flops / (self.balance * self.entries)


class Factor(Protocol):
    """A factorised symmetric matrix."""

    work: Work

    def solve(self, b: Array) -> Array:
        """Solution of A x = b, for b (N,) or (N, k)."""
        ...

    def refactorise(self, matrix: sp.csr_matrix) -> None:
        """Factorise another matrix, reusing the symbolic analysis where the pattern is the same.

        Raises as `linear.factorise`; a later matrix may succeed, but until then there is no factor.
        """
        ...


class MatrixPattern:
    """Pattern of a CSR matrix, to check whether another matrix has the same."""

    def __init__(self, matrix: sp.csr_matrix) -> None:
        self.indptr, self.indices = matrix.indptr, matrix.indices

    def fits(self, matrix: sp.csr_matrix) -> bool:
        """Immediate where the index arrays are shared."""
        if len(self.indptr) != len(matrix.indptr) or len(self.indices) != len(matrix.indices):
            return False
        shared = self.indices.ctypes.data == matrix.indices.ctypes.data
        return np.array_equal(self.indptr, matrix.indptr) and (
            shared or np.array_equal(self.indices, matrix.indices)
        )


def check_memory(work: Work, limit: float) -> None:
    """Raise `FactorTooLarge` where the prediction is beyond the limit in bytes."""
    if work.bytes > limit:
        raise FactorTooLarge(
            f"the factor would take {work.bytes / 2**20:.0f} MiB, allowed are {limit / 2**20:.0f} MiB"
        )
