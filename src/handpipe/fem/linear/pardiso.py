"""Factorisation by Pardiso of Intel MKL, which the `mkl` package brings."""

from __future__ import annotations

import ctypes
import importlib.metadata
import logging
import os
import sys
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import NDArray

from handpipe.core import Array, Int32Array
from handpipe.fem.linear.factor import MatrixPattern, NotPositiveDefinite, SingularMatrix, Work, check_memory

log = logging.getLogger(__name__)

BALANCE = 28.0  # flops in the time of an iteration, per entry of L: see Work
ANALYSE, FACTORISE, SOLVE, RELEASE = 11, 22, 33, -1  # phases, of the MKL reference
ERRORS = {  # of the MKL reference
    -1: "the input is inconsistent",
    -2: "there is not enough memory",
    -3: "the reordering failed",
    -4: "a pivot is zero",
    -7: "the diagonal matrix is singular",
    -8: "the factor needs 64-bit indices",
    -10: "a file could not be opened",
}


def load() -> bool:
    """Load MKL's library; False where it is not installed."""
    PardisoFactor.library = PardisoFactor.library or _load()
    return PardisoFactor.library is not None


def _load() -> ctypes.CDLL | None:
    candidates: list[Path] = []
    try:
        files = importlib.metadata.files("mkl") or []
        candidates += [Path(str(f.locate())) for f in files if "libmkl_rt" in f.name]
    except importlib.metadata.PackageNotFoundError:
        pass
    candidates += sorted((Path(sys.prefix) / "lib").glob("libmkl_rt.so*"))
    # Idle threads of MKL would spin for a fifth of a second and take the cores from later work.
    os.environ.setdefault("KMP_BLOCKTIME", "0")
    for path in candidates:
        try:
            return ctypes.CDLL(str(path))
        except OSError as error:
            log.warning("cannot load %s: %s", path, error)
    return None


class PardisoFactor:
    """Matrix type 2 (positive definite) or -2 (indefinite) of the upper triangle, nested dissection by METIS.

    OMP_NUM_THREADS or MKL_NUM_THREADS set the number of threads. Memory is freed when the factor is deleted.
    With `single`, the factor is in single precision, half as large: a preconditioner rather than a solver.
    """

    library: ctypes.CDLL | None = None  # see `load`

    def __init__(
        self,
        matrix: sp.csr_matrix | None = None,
        positive: bool = True,
        memory_limit: float = float("inf"),
        single: bool = False,
    ) -> None:
        """Raises as `linear.factorise`. Without a matrix, `refactorise` takes the first one."""
        self._real = np.float32 if single else np.float64
        self.work = Work(0.0, 0.0, 0.0, BALANCE)
        self._limit = memory_limit
        self._handle = np.zeros(64, dtype=np.int64)
        self._type = 2 if positive else -2
        self._pattern: MatrixPattern | None = None
        self._values = np.zeros(0)
        self._parameters = np.zeros(64, dtype=np.int32)
        self._parameters[0] = 1  # all parameters are given here
        self._parameters[1] = 2  # nested dissection by METIS
        # Refinement doubles the time of a solve. A Cholesky factor does not need it, perturbed pivots do.
        self._parameters[7] = 0 if positive else 2
        self._parameters[9] = 8 if not positive else 13  # pivots perturbed below 10^-8
        self._parameters[20] = 1  # Bunch-Kaufman pivoting
        self._parameters[27] = int(single)
        self._parameters[34] = 1  # indices from zero
        if matrix is not None:
            self.refactorise(matrix)

    def refactorise(self, matrix: sp.csr_matrix) -> None:
        """Factorise another matrix, reusing the symbolic analysis where the pattern is the same."""
        matrix.sort_indices()
        if self._pattern is None or not self._pattern.fits(matrix):
            self._analyse(matrix)
        self._values = matrix.data[self._places].astype(self._real, copy=False)
        self._call(FACTORISE)

    def solve(self, b: Array) -> Array:
        """Solution of A x = b, for b (N,) or (N, k), in the memory order of b."""
        size = float(np.abs(b).max(initial=0.0)) if self._real is np.float32 else 1.0
        scale = size or 1.0  # keeps small forces within the range of single precision
        columns = np.asfortranarray(b if scale == 1.0 else b / scale, dtype=self._real)
        x = np.empty_like(columns)
        self._call(SOLVE, columns, x, count=1 if b.ndim == 1 else b.shape[1])
        if self._real is np.float32:
            x = scale * x.astype(float, order="F")
        return x if b.flags.f_contiguous else np.ascontiguousarray(x)

    @property
    def negative_eigenvalues(self) -> int:
        """Number of negative eigenvalues of an indefinite matrix."""
        return int(self._parameters[22])

    def _analyse(self, matrix: sp.csr_matrix) -> None:
        self._release()
        self._size = matrix.shape[0]
        self._indptr, self._indices, self._places = _upper_triangle(
            matrix.indptr.astype(np.int32, copy=False), matrix.indices.astype(np.int32, copy=False)
        )
        self._values = matrix.data[self._places].astype(self._real, copy=False)
        self._parameters[17] = self._parameters[18] = -1  # report the factor's entries and the flops
        self._call(ANALYSE)
        kibibytes = self._parameters[14:17].astype(float)
        self.work = Work(
            flops=1e6 * float(self._parameters[18]),
            entries=_unwrapped(self._parameters[17]),
            bytes=1024.0 * float(max(kibibytes[0], kibibytes[1] + kibibytes[2])),
            balance=BALANCE,
        )
        check_memory(self.work, self._limit)
        self._pattern = MatrixPattern(matrix)

    def _call(self, phase: int, b: NDArray | None = None, x: NDArray | None = None, count: int = 1) -> None:
        assert self.library is not None
        nothing = np.zeros(1)

        def integer(value: int) -> ctypes._CArgObject:  # type: ignore[name-defined]
            return ctypes.byref(ctypes.c_int32(value))

        error = ctypes.c_int32(0)
        permutation = np.zeros(1, dtype=np.int32)
        self.library.pardiso(
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
            _as_pointer(nothing if b is None else b),
            _as_pointer(nothing if x is None else x),
            ctypes.byref(error),
        )
        if error.value == -4 and self._type == 2:
            raise NotPositiveDefinite("the matrix is not positive definite")
        if error.value != 0:
            reason = ERRORS.get(error.value, f"error {error.value}")
            raise SingularMatrix(f"Pardiso, {self._size} unknowns, phase {phase}: {reason}")

    def _release(self) -> None:
        if self._handle.any():
            self._call(RELEASE)
            self._handle[:] = 0
        self._pattern = None

    def __del__(self) -> None:
        """Returns the factor's memory to Pardiso, except while the interpreter shuts down."""
        if not sys.is_finalizing() and hasattr(self, "_parameters"):
            self._release()


def _as_pointer(array: NDArray) -> ctypes.c_void_p:
    return array.ctypes.data_as(ctypes.c_void_p)


def _unwrapped(count: np.int32) -> float:
    """A count that may have passed the largest 32-bit integer once."""
    return float(count) if count >= 0 else float(count) + 2.0**32


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
