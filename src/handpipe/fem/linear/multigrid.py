"""Algebraic multigrid by smoothed aggregation with rigid modes (pyamg), for factors that do not fit."""

from __future__ import annotations

import numpy as np
import pyamg
import scipy.sparse as sp

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.fem.linear.factor import Factor
from handpipe.fem.linear.factorisation import factorise
from handpipe.fem.linear.nullspace import rigid_modes

COARSEST = 12_000  # unknowns that are factorised: a third fewer iterations than with further levels
STRENGTH = 0.03  # of a connection that aggregates; at 0.08 aggregates are small for nu = 0.3
SWEEP = ("block_gauss_seidel", {"sweep": "symmetric"})


class Multigrid:
    """One V-cycle for a positive definite matrix (N, N): symmetric, hence a preconditioner of CG.

    Vertices keep their three unknowns together (block size 3). Where only some of them are free, the fixed
    ones are filled in with a diagonal, which does not change the solution of the others.
    """

    def __init__(self, matrix: sp.csr_matrix, free: BoolArray, rest: Array) -> None:
        """`free` is a mask (3n,) of N unknowns, `rest` (n, 3) positions, whose rigid modes are near-null.

        Raises `NotPositiveDefinite` where the coarsest matrix is not, hence neither the finest.
        """
        if free.sum() != matrix.shape[0] or free.size != rest.size:
            problem = f"{matrix.shape[0]} rows, {free.sum()} unknowns of {free.size}, rest has {rest.size}"
            raise InputError("multigrid", "free", problem, "Pass the mask of unknowns to `solve`")
        kept = free.reshape(-1, 3).any(axis=1)
        within = free.reshape(-1, 3)[kept].ravel()
        self._places: IntArray = np.flatnonzero(within)
        self._size = within.size
        modes = rigid_modes(rest[kept])
        modes[~within] = 0.0
        self._levels = pyamg.smoothed_aggregation_solver(
            self._fill(matrix).tobsr((3, 3)),
            B=modes,
            symmetry="symmetric",
            strength=("symmetric", {"theta": STRENGTH}),
            improve_candidates=None,  # rigid modes are good as they are
            max_coarse=min(COARSEST, self._size // 8),
            coarse_solver=self._solve_coarsest,
            presmoother=SWEEP,
            postsmoother=SWEEP,
        )
        self._coarsest = _factorise(self._levels.levels[-1].A)
        self._padded = np.zeros(self._size)

    def __call__(self, r: Array) -> Array:
        """Approximate solution (N,) for a right-hand side (N,)."""
        self._padded[self._places] = r
        return self._levels.solve(self._padded, maxiter=1, cycle="V", tol=1e-300)[self._places]

    def _solve_coarsest(self, matrix: sp.csr_matrix, r: Array) -> Array:
        return self._coarsest.solve(r.ravel()).reshape(r.shape)

    def _fill(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        """The matrix with the fixed unknowns of kept vertices as rows and columns of a scaled identity."""
        if self._size == matrix.shape[0]:
            return matrix
        spread = sp.csr_matrix(
            (np.ones(len(self._places)), (self._places, np.arange(len(self._places)))),
            shape=(self._size, len(self._places)),
        )
        diagonal = np.full(self._size, float(np.abs(matrix.diagonal()).mean()))
        diagonal[self._places] = 0.0
        return sp.csr_matrix(spread @ matrix @ spread.T + sp.diags(diagonal))


def _factorise(matrix: sp.spmatrix) -> Factor:
    """Factor of a coarse matrix; small aggregates leave rows of zeros, which get a diagonal."""
    coarse = sp.csr_matrix(matrix)
    diagonal = coarse.diagonal()
    size = float(np.abs(diagonal).max())
    empty = np.abs(diagonal) < 1e-12 * size
    return factorise(sp.csr_matrix(coarse + sp.diags(np.where(empty, size, 1e-14 * size))))
