"""Matrices of diffusion with spread (Eq. 13), whose pattern and gradients are kept from muscle to muscle."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.anatomy.editing.constrained import Harmonic
from handpipe.anatomy.editing.greens_matrix import GreensMatrix
from handpipe.anatomy.templates.diffusion import Collocation, Factorise, tensors_through
from handpipe.core import Array
from handpipe.mesh.tets import TetMesh, shape_gradients


class SpreadMatrices:
    """Laplacians of muscles with spread on one mesh.

    Parameters
    ----------
    mesh : TetMesh
        Mesh in mm.
    laplacian : sparse matrix (n, n)
        Its isotropic Laplacian.
    weight : float
        The paper's alpha per mm of curve.
    factorise : callable
        Factors symmetric positive definite matrices.
    """

    def __init__(
        self, mesh: TetMesh, laplacian: sparse.csr_matrix, weight: float, factorise: Factorise
    ) -> None:
        self._mesh, self._weight = mesh, weight
        self._harmonic = Harmonic(GreensMatrix(laplacian, np.zeros(1, np.int64), factorise))
        self._gradients = shape_gradients(mesh.vertices, mesh.tets)
        self._volumes = mesh.volumes()
        count = len(mesh.vertices)
        rows, columns = np.repeat(mesh.tets, 4, axis=1).ravel(), np.tile(mesh.tets, 4).ravel()
        keys, self._entries = np.unique(rows * count + columns, return_inverse=True)
        self._entries = self._entries.reshape(-1)
        starts = np.searchsorted(keys, np.arange(count + 1) * count)
        self._pattern = keys % count, starts

    def of(self, collocation: Collocation) -> sparse.csr_matrix:
        """The matrix (n, n) of a muscle."""
        at_points, weights = collocation.matrix(self._mesh), self._weight * collocation.lengths
        tensors = tensors_through(
            self._mesh, collocation, lambda data: self._harmonic.through(at_points, weights, data)
        )
        return self._assembled(tensors)

    def _assembled(self, tensors: Array) -> sparse.csr_matrix:
        flux = self._gradients @ (tensors * self._volumes[:, None, None])
        energies = flux @ np.swapaxes(self._gradients, 1, 2)
        columns, starts = self._pattern
        data = np.bincount(self._entries, energies.ravel(), len(columns))
        return sparse.csr_matrix((data, columns, starts), shape=(len(starts) - 1,) * 2)
