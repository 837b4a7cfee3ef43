"""Sparse symmetric factorisations through one interface, by the best library that is present.

Pardiso of MKL where the `mkl` package is installed, rslab elsewhere, SuperLU of scipy as the last resort.
HANDPIPE_SOLVER = mkl, rslab or scipy chooses at import.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from typing import Protocol

import scipy.sparse as sp

from handpipe.core import InputError
from handpipe.fem.linear import pardiso, supernodal
from handpipe.fem.linear.factor import Factor, FactorTooLarge, NotPositiveDefinite, SingularMatrix, Work
from handpipe.fem.linear.pardiso import PardisoFactor
from handpipe.fem.linear.superlu import SuperLUFactor
from handpipe.fem.linear.supernodal import SupernodalFactor

__all__ = [
    "Factor",
    "FactorTooLarge",
    "NotPositiveDefinite",
    "PardisoFactor",
    "SingularMatrix",
    "SuperLUFactor",
    "SupernodalFactor",
    "Work",
    "backend",
    "factorise",
    "unfactorised",
]

log = logging.getLogger(__name__)


class Backend(Protocol):
    """A class of factors."""

    def __call__(self, matrix: sp.csr_matrix | None, positive: bool, memory_limit: float) -> Factor: ...


PRESENT: dict[str, Callable[[], bool]] = {
    "mkl": pardiso.load,
    "rslab": supernodal.available,
    "scipy": lambda: True,
}
CLASSES: dict[str, Backend] = {"mkl": PardisoFactor, "rslab": SupernodalFactor, "scipy": SuperLUFactor}


def _choose() -> str:
    wanted = os.environ.get("HANDPIPE_SOLVER", "").lower()
    if wanted and wanted not in CLASSES:
        raise InputError(
            "environment", "HANDPIPE_SOLVER", f"{wanted!r} is no solver", f"Choose of {', '.join(CLASSES)}"
        )
    for name in [wanted] if wanted else CLASSES:
        if PRESENT[name]():
            return name
        if wanted:
            raise InputError("environment", "HANDPIPE_SOLVER", f"{wanted} is not installed", "Unset it")
    raise AssertionError("scipy is always there")


backend = _choose()
if backend == "scipy":
    log.info("neither MKL nor rslab is there: sparse systems are solved by SuperLU, many times slower")


def factorise(
    matrix: sp.csr_matrix, positive: bool = True, memory_limit: float = float("inf"), single: bool = False
) -> Factor:
    """Factor of a symmetric matrix.

    Parameters
    ----------
    matrix : sparse matrix (N, N)
        Both triangles of the matrix in CSR form.
    positive : bool
        Whether the matrix must be positive definite.
    memory_limit : float
        Largest memory in bytes that the factor may need.
    single : bool
        Factorise in single precision where the library can (MKL), in about half the time and memory.
        Solutions then need refinement.

    Returns
    -------
    Factor
        Solves systems with the matrix, and refactorises.

    Raises
    ------
    NotPositiveDefinite
        If `positive` is set and the matrix is not positive definite.
    SingularMatrix
        If there is no factor.
    FactorTooLarge
        Before the factorisation, if the factor is predicted to need more than `memory_limit`.
    """
    factor = unfactorised(positive, memory_limit, single)
    factor.refactorise(matrix)
    return factor


def unfactorised(positive: bool = True, memory_limit: float = float("inf"), single: bool = False) -> Factor:
    """A factor without a matrix yet; arguments as of `factorise`.

    It keeps the analysis of the first matrix even where that cannot be factorised.
    """
    if single and backend == "mkl":
        return PardisoFactor(None, positive, memory_limit, single=True)
    return CLASSES[backend](None, positive, memory_limit)
