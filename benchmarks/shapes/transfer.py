"""The energy of deformation transfer without a source (Sumner and Popovic 2004), as a potential."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array
from handpipe.mesh.tets import TetMesh, gradient_operator, tet_laplacian

REACH = 10.0  # mm: gradients that change over this length count as much as strains


class SmoothGradients:
    """w / 2 times the sum of |F_i - F_j|^2 over neighbouring tets: zero for affine maps.

    w is the stiffness (kPa) times REACH^2 times the tets' size, so that the sum is about an integral, the
    same on any mesh.
    """

    def __init__(self, mesh: TetMesh, stiffness: float) -> None:
        size = float(np.cbrt(np.abs(mesh.volumes()).mean()))
        gradient = gradient_operator(mesh.vertices, mesh.tets)
        differences = sp.kron(tet_laplacian(mesh.tets), sp.identity(9), format="csr")
        self._matrix = (stiffness * REACH**2 * size * (gradient.T @ differences @ gradient)).tocsr()
        self._matrix.sort_indices()

    def value(self, x: Array) -> float:
        """Energy in microjoules."""
        return 0.5 * float(x.ravel() @ (self._matrix @ x.ravel()))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN."""
        return (self._matrix @ x.ravel()).reshape(x.shape)

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm, constant and semidefinite."""
        return self._matrix
