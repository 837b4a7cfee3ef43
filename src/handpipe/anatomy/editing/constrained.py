"""A Laplacian with the constraints of curves, solved by the Laplacian's factor that is kept.

K is the Laplacian of the free vertices, B the matrix of all curves (Eq. 8), W the weights of its rows. In
`diffuse`, (K + B^T W B) f = B^T W d for the tissue values d of a muscle, which are zero at the other curves.
With S = W^-1 + B K^-1 B^T, which has a few hundred rows, one for each way of a curve through a tet,

    (K + B^T W B)^-1 B^T W = K^-1 B^T S^-1,
    (K + B^T W B)^-1 = K^-1 - K^-1 B^T S^-1 B K^-1.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse.linalg import LinearOperator, cg

from handpipe.anatomy.editing.greens_matrix import GreensMatrix
from handpipe.core import Array, ConvergenceError

TOLERANCE = 1e-10  # of the residual of a muscle with spread, over its load
ITERATIONS = 1000  # of conjugate gradients, at most


class Constrained:
    """K + B^T W B, by the Green's functions of K.

    Parameters
    ----------
    greens : GreensMatrix
        Of the Laplacian K.
    at_points : sparse matrix (c, n)
        B: values at the curves' points from values at the vertices.
    weights : array (c,)
        Diagonal of W.
    """

    def __init__(self, greens: GreensMatrix, at_points: sparse.csr_matrix, weights: Array) -> None:
        self._greens, self._at_points, self._weights = greens, at_points, weights
        vertices = np.unique(at_points.indices)
        near = at_points[:, vertices]
        self._factor = cho_factor(near @ (near @ greens.between(vertices)).T + np.diag(1 / weights))

    def functions(self, data: Array) -> Array:
        """Functions (n, k) for data (c, k) at the points: K^-1 B^T S^-1 d."""
        return self._greens.solve(self._at_points.T @ cho_solve(self._factor, data))

    def inverse(self, loads: Array) -> Array:
        """(K + B^T W B)^-1 of loads (n,)."""
        values = self._greens.solve(loads[:, None])
        return np.asarray((values - self.functions(self._at_points @ values))[:, 0])

    def function_of(self, own: sparse.csr_matrix, data: Array, start: Array | None) -> Array:
        """The function (n,) of a muscle that has a Laplacian of its own, for data (c,) at the points.

        Conjugate gradients are preconditioned by this matrix: the condition number is the ratio of the
        largest to the smallest rate of diffusion.
        """
        at_points, free = self._at_points, np.zeros(own.shape[0])
        free[self._greens.free] = 1.0

        def product(x: Array) -> Array:
            x = x.ravel()
            return np.asarray(free * (own @ x + at_points.T @ (self._weights * (at_points @ x))))

        system = LinearOperator(own.shape, product, dtype=np.float64)
        inverse = LinearOperator(own.shape, lambda x: self.inverse(x.ravel()), dtype=np.float64)
        load = free * (at_points.T @ (self._weights * data))
        values, failed = cg(system, load, start, rtol=TOLERANCE, maxiter=ITERATIONS, M=inverse)
        if failed:
            raise ConvergenceError(
                "the diffusion of a muscle with spread",
                f"the residual is too large after {ITERATIONS} iterations",
                "Choose rates of `spread` that are closer to 1.",
            )
        return np.asarray(values)


class Harmonic:
    """Harmonic functions with natural boundaries that take values at curves, as `spread_from_curves`.

    The Laplacian is singular: constants have no energy. Its factor is fixed at one vertex. The constant is
    solved for with the loads at the points, whose sum is zero.

    Parameters
    ----------
    pinned : GreensMatrix
        Of the Laplacian, fixed at one vertex.
    """

    def __init__(self, pinned: GreensMatrix) -> None:
        self._pinned = pinned

    def through(self, at_points: sparse.csr_matrix, weights: Array, data: Array) -> Array:
        """Functions (n, k) that take data (c, k) at the points, with the weights (c,) of their rows."""
        vertices = np.unique(at_points.indices)
        near = at_points[:, vertices]
        count = len(weights)
        system = np.ones((count + 1, count + 1))
        system[:count, :count] = near @ (near @ self._pinned.between(vertices)).T + np.diag(1 / weights)
        system[count, count] = 0.0
        solution = np.linalg.solve(system, np.vstack([data, np.zeros((1, data.shape[1]))]))
        return np.asarray(self._pinned.solve(at_points.T @ solution[:count]) + solution[count])
