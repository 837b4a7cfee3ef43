"""Sparse symmetric factorisations: Pardiso of the `mkl` package where it is installed, SuperLU elsewhere."""

from __future__ import annotations

import ctypes
import importlib.metadata
import logging
import os
import sys
from pathlib import Path
from typing import Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numba import njit
from numpy.typing import NDArray

from handpipe.errors import HandpipeError

Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]
log = logging.getLogger(__name__)


class NotPositiveDefinite(HandpipeError):
    """A matrix that was to be positive definite is not."""


class SingularMatrix(HandpipeError):
    """A matrix could not be factorised."""


class Factor(Protocol):
    """A factorised symmetric matrix."""

    def solve(self, b: Array) -> Array:
        """Solution of A x = b, for b (N,) or (N, k)."""
        ...

    def refactorise(self, matrix: sp.csr_matrix) -> None:
        """Factorise another matrix, reusing the symbolic analysis where the pattern is the same."""
        ...


def factorise(matrix: sp.csr_matrix, positive: bool = True) -> Factor:
    """Factorise a full symmetric CSR matrix (N, N); `positive` asks for a Cholesky factorisation.

    Raises `NotPositiveDefinite` where that was asked for and is impossible, `SingularMatrix` otherwise.
    """
    return PardisoFactor(matrix, positive) if _mkl is not None else SuperLUFactor(matrix, positive)


def _find_mkl() -> ctypes.CDLL | None:
    if os.environ.get("HANDPIPE_SOLVER", "").lower() == "scipy":
        return None
    candidates: list[Path] = []
    try:
        files = importlib.metadata.files("mkl") or []
        candidates += [Path(str(f.locate())) for f in files if "libmkl_rt" in f.name]
    except importlib.metadata.PackageNotFoundError:
        pass
    candidates += sorted((Path(sys.prefix) / "lib").glob("libmkl_rt.so*"))
    for path in candidates:
        try:
            return ctypes.CDLL(str(path))
        except OSError as error:
            log.warning("cannot load %s: %s", path, error)
    log.info("MKL not found: sparse systems are solved by SuperLU, many times slower")
    return None


_mkl = _find_mkl()


def _as_pointer(array: NDArray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


class PardisoFactor:
    """Intel MKL Pardiso, matrix type 2 (positive definite) or -2 (indefinite), from the upper triangle."""

    def __init__(self, matrix: sp.csr_matrix, positive: bool = True) -> None:
        self._handle = np.zeros(64, dtype=np.int64)
        self._type = 2 if positive else -2
        self._source: sp.csr_matrix | None = None
        self._parameters = np.zeros(64, dtype=np.int32)
        self._parameters[0] = 1  # all parameters are given here
        self._parameters[1] = 2  # nested dissection by METIS
        self._parameters[7] = 2  # at most two steps of iterative refinement
        self._parameters[9] = 8 if not positive else 13  # pivots perturbed below 10^-8
        self._parameters[20] = 1  # Bunch-Kaufman pivoting
        self._parameters[34] = 1  # indices from zero
        self.refactorise(matrix)

    def refactorise(self, matrix: sp.csr_matrix) -> None:
        known = self._source is not None and _shares_pattern(self._source, matrix)
        if not known:
            self._release()
            matrix.sort_indices()
            self._size = matrix.shape[0]
            self._indptr, self._indices, self._places = _upper_triangle(
                matrix.indptr.astype(np.int32, copy=False), matrix.indices.astype(np.int32, copy=False)
            )
        self._source = matrix
        self._values = matrix.data[self._places]
        nothing = np.zeros(1)
        if not known:
            self._call(11, nothing, nothing)
        self._call(22, nothing, nothing)

    def solve(self, b: Array) -> Array:
        columns = np.asfortranarray(b, dtype=float)
        x = np.empty_like(columns)
        self._call(33, columns, x, count=1 if b.ndim == 1 else b.shape[1])
        return np.ascontiguousarray(x)

    @property
    def negative_eigenvalues(self) -> int:
        """Number of negative eigenvalues of an indefinite matrix."""
        return int(self._parameters[22])

    def _call(self, phase: int, b: Array, x: Array, count: int = 1) -> None:
        assert _mkl is not None

        def integer(value: int) -> ctypes._CArgObject:  # type: ignore[name-defined]
            return ctypes.byref(ctypes.c_int32(value))

        error = ctypes.c_int32(0)
        permutation = np.zeros(1, dtype=np.int32)
        _mkl.pardiso(
            _as_pointer(self._handle),
            integer(1),
            integer(1),
            integer(self._type),
            integer(phase),
            integer(self._size),
            _as_pointer(self._values),
            _as_pointer(self._indptr),
            _as_pointer(self._indices),
            _as_pointer(permutation),
            integer(count),
            _as_pointer(self._parameters),
            integer(0),
            _as_pointer(b),
            _as_pointer(x),
            ctypes.byref(error),
        )
        if error.value == -4 and self._type == 2:
            raise NotPositiveDefinite("the matrix is not positive definite")
        if error.value != 0:
            raise SingularMatrix(f"Pardiso failed in phase {phase} with error {error.value}")

    def _release(self) -> None:
        if self._source is not None and self._handle.any():
            nothing = np.zeros(1)
            self._call(-1, nothing, nothing)
            self._handle[:] = 0
            self._source = None

    def __del__(self) -> None:
        if not sys.is_finalizing() and hasattr(self, "_values"):
            self._release()


class SuperLUFactor:
    """scipy's SuperLU in symmetric mode; slow, but present wherever scipy is."""

    def __init__(self, matrix: sp.csr_matrix, positive: bool = True) -> None:
        self._positive = positive
        self.refactorise(matrix)

    def refactorise(self, matrix: sp.csr_matrix) -> None:
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

    def solve(self, b: Array) -> Array:
        return self._lu.solve(np.asarray(b, dtype=float))


def _shares_pattern(a: sp.csr_matrix, b: sp.csr_matrix) -> bool:
    if a.shape != b.shape or a.nnz != b.nnz:
        return False
    if np.may_share_memory(a.indices, b.indices):
        return True
    return np.array_equal(a.indptr, b.indptr) and np.array_equal(a.indices, b.indices)


@njit(cache=True)
def _upper_triangle(indptr: Int32Array, indices: Int32Array) -> tuple[Int32Array, Int32Array, Int32Array]:
    """Pattern of the upper triangle, and where its entries stand in the full matrix."""
    n = len(indptr) - 1
    starts = np.zeros(n + 1, dtype=np.int32)
    for row in range(n):
        count = 0
        for k in range(indptr[row], indptr[row + 1]):
            if indices[k] >= row:
                count += 1
        starts[row + 1] = starts[row] + count
    columns = np.empty(starts[n], dtype=np.int32)
    places = np.empty(starts[n], dtype=np.int32)
    at = 0
    for row in range(n):
        for k in range(indptr[row], indptr[row + 1]):
            if indices[k] >= row:
                columns[at] = indices[k]
                places[at] = k
                at += 1
    return starts, columns, places
