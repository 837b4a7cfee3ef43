"""Two levels where a factor does not fit: a coarse space is factorised, the rest smoothed."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from pyamg.relaxation.relaxation import block_gauss_seidel

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.fem.linear.factorisation import factorise


class TwoLevel:
    """One symmetric cycle for a positive definite matrix (N, N), hence a preconditioner of CG.

    The coarse space are fields that a matrix P carries from few nodes to all, as linear elements' to the
    midpoints of quadratic ones; P^T A P is factorised. Before and after it a sweep of block Gauss-Seidel
    over the nodes, forward and backward.
    """

    def __init__(self, matrix: sp.csr_matrix, free: BoolArray, prolongation: sp.csr_matrix) -> None:
        """Factor of the coarse matrix, and inverses of the diagonal blocks of the fine one.

        `free` is a mask (3n,) of N unknowns, three or none of each node; `prolongation` is (n, c), whose
        columns have a one each at the first node with their largest entry, and are fixed where that node is.

        Raises `NotPositiveDefinite` where the coarse matrix is not, hence neither the fine one.
        """
        constrained = ~free.reshape(-1, 3)
        if (constrained.any(axis=1) != constrained.all(axis=1)).any():
            problem = "holds some nodes in some directions only"
            raise InputError("two levels", "free", problem, "Solve without a coarse space")
        nodes = ~constrained[:, 0]
        among = prolongation[nodes][:, nodes[_own_nodes(prolongation)]]
        self._carry = sp.kron(among, sp.eye(3), format="csr")
        self._gather = self._carry.T.tocsr()
        coarse = sp.csr_matrix(self._gather @ (matrix @ self._carry))
        coarse.sort_indices()
        self._factor = factorise(coarse)
        self._blocks = matrix.tobsr((3, 3))
        self._inverse = np.linalg.inv(_diagonal(self._blocks))

    def __call__(self, r: Array) -> Array:
        """Approximate solution (N,) for a right-hand side (N,)."""
        x = np.zeros_like(r)
        self._sweep(x, r, "forward")
        x += self._carry @ self._factor.solve(self._gather @ (r - self._blocks @ x))
        self._sweep(x, r, "backward")
        return x

    def _sweep(self, x: Array, r: Array, order: str) -> None:
        block_gauss_seidel(self._blocks, x, r, sweep=order, blocksize=3, Dinv=self._inverse)


def with_nodes(prolongation: sp.csr_matrix, nodes: IntArray) -> sp.csr_matrix:
    """Prolongation with further nodes in the coarse space.

    Smoothing converges too slowly where springs on single nodes are far stiffer than the rest.

    Parameters
    ----------
    prolongation : sparse matrix (n, c)
        Carries fields from c coarse nodes to all n.
    nodes : integer array (k,)
        Nodes to add; nodes already in the coarse space are skipped.

    Returns
    -------
    sparse matrix (n, c + new)
        The prolongation with a column more for each new node, one at that node alone.
    """
    new = np.setdiff1d(nodes, _own_nodes(prolongation))
    ones = (np.ones(len(new)), (new, np.arange(len(new))))
    return sp.hstack(
        [prolongation, sp.csr_matrix(ones, shape=(prolongation.shape[0], len(new)))], format="csr"
    )


def _own_nodes(prolongation: sp.csr_matrix) -> IntArray:
    """The node (c,) with the largest entry of each column, the first of several."""
    return np.asarray(prolongation.tocsc().argmax(axis=0)).ravel()


def _diagonal(blocks: sp.bsr_matrix) -> Array:
    """The blocks (n, 3, 3) on the diagonal."""
    rows = np.repeat(np.arange(len(blocks.indptr) - 1), np.diff(blocks.indptr))
    return np.ascontiguousarray(blocks.data[rows == blocks.indices])
