"""Unconstrained bodies: the six rigid-body modes, and linear solves modulo them (Wang 2021 §5.5)."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from handpipe.core import Array, IntArray
from handpipe.fem.linear.factorisation import factorise


def unit_twists(x: Array, centre: Array, size: float) -> Array:
    """Translations and infinitesimal rotations of positions about a centre, as columns.

    Parameters
    ----------
    x : array (n, 3)
        Positions in mm.
    centre : array (3,)
        Point in mm that rotations leave where it is.
    size : float
        Length in mm by which rotations are divided, so that they compare with translations.

    Returns
    -------
    array (3n, 6)
        Unit translations along the axes, then rotations about the axes by 1 / size.
    """
    arms = (x - centre) / size
    modes = np.zeros((len(x), 3, 6))
    for i in range(3):
        modes[:, i, i] = 1.0
        modes[:, :, 3 + i] = np.cross(np.eye(3)[i], arms)
    return modes.reshape(-1, 6)


def rigid_modes(x: Array) -> Array:
    """Orthonormal basis (3n, 6) of translations and infinitesimal rotations about positions x (n, 3).

    At an equilibrium without supports they span the nullspace of the tangent stiffness (Wang 2021, Nullspace
    Lemma).
    """
    return np.linalg.qr(unit_twists(x, x.mean(axis=0), 1.0))[0]


def rigid_pins(x: Array) -> IntArray:
    """Six degrees of freedom (6,) whose fixing stops the rigid motions and no deformation.

    They are the pivots of a QR factorisation of the modes, hence far from dependent. Since the energy of a
    free body does not change in rigid motion, an equilibrium with these fixed has no reactions: it is a free
    one.
    """
    pivots = scipy.linalg.qr(rigid_modes(x).T, mode="economic", pivoting=True)[2]
    return np.sort(pivots[:6]).astype(np.int64)


class DeflatedFactor:
    """Solutions of K u = b orthogonal to the nullspace of a positive semidefinite K.

    The bordered system of Wang 2021 Eq. 5.15 has dense columns. Here as many degrees of freedom as there are
    modes are fixed at zero, which leaves a sparse positive definite matrix; for b in the range of K its
    solution is one of K u = b, and projecting the modes out makes it the orthogonal one. b is first projected
    into the range.

    Parameters
    ----------
    matrix : sparse matrix (N, N)
        K.
    modes : array (N, k)
        Orthonormal basis of the nullspace of K.

    Raises
    ------
    NotPositiveDefinite
        If K is not positive definite on the remaining degrees of freedom.
    SingularMatrix
        If there is no factor.

    References
    ----------
    Wang 2021, Singular Lemma ii and Eq. 5.15.
    """

    def __init__(self, matrix: sp.csr_matrix, modes: Array) -> None:
        self.modes = modes
        pivots = scipy.linalg.qr(modes.T, mode="economic", pivoting=True)[2]
        self.free = np.setdiff1d(np.arange(len(modes)), pivots[: modes.shape[1]])
        self._factor = factorise(sp.csr_matrix(matrix[self.free][:, self.free]), positive=True)

    def solve(self, b: Array) -> Array:
        """Solution for b (N,) or (N, k)."""
        u = np.zeros_like(b, dtype=float)
        u[self.free] = self._factor.solve((b - self.modes @ (self.modes.T @ b))[self.free])
        return u - self.modes @ (self.modes.T @ u)
