"""Bending of a surface with a rotation a vertex (Wang 2021 Eq. 5.28), and what it is once plastic.

E_bend = sum of A |H - R H0|^2 over vertices, H the mean curvature vector, A the vertex' area, and R the
rotation that best turns its edges at rest into those of the present shape. Rotations and vertices are found
in turn; marked vertices are met exactly. With incremental plasticity the surface rests where the last
increment left it (Wang 2021 §5.9.8; Gietzen 2019 Eq. 5).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg

from handpipe.core import Array, ConvergenceError, IntArray
from handpipe.fem.elements import polar
from handpipe.mesh.tets import cotangent_laplacian, mass_lumped

ROUNDS, SETTLED = 2000, 1e-5  # at most; mm that a round still moves any vertex by
FLAT = 1e-6  # least weight of an edge, instead of negative cotangents


class Bending:
    """E_bend of a surface at rest, with some vertices at known places.

    rest: vertices (n, 3) in mm; triangles (k, 3); points: known vertices (r,).
    """

    def __init__(self, rest: Array, triangles: IntArray, points: IntArray) -> None:
        self.points = points
        self.free = np.setdiff1d(np.arange(len(rest)), points)
        laplacian = cotangent_laplacian(rest, triangles)
        self._laplacian = laplacian
        areas = mass_lumped(rest, triangles)
        self._areas = areas
        self._curvature = (laplacian @ rest) / areas[:, None]  # H0
        matrix = (laplacian @ sp.diags(1 / areas) @ laplacian).tocsc()
        self._coupling = matrix[self.free][:, self.points]
        self._solve = scipy.sparse.linalg.factorized(matrix[self.free][:, self.free].tocsc())
        off = sp.triu(laplacian, 1).tocoo()
        both = np.concatenate([off.row, off.col]), np.concatenate([off.col, off.row])
        self._from, self._to = both
        self._weights = np.maximum(np.tile(-off.data, 2), FLAT)
        self._edges = rest[self._to] - rest[self._from]

    def rotations(self, x: Array) -> Array:
        """Rotations (n, 3, 3) of the vertices' edges from rest to x (n, 3)."""
        edges = x[self._to] - x[self._from]
        products = (self._weights[:, None] * edges)[:, :, None] * self._edges[:, None, :]
        sums = sp.csr_matrix(
            (np.ones(len(self._from)), (self._from, np.arange(len(self._from)))),
            shape=(len(x), len(self._from)),
        )
        return polar((sums @ products.reshape(-1, 9)).reshape(-1, 3, 3))[0]

    def energy(self, x: Array) -> float:
        """E_bend, without the factor of the whole area."""
        wanted = np.einsum("nij,nj->ni", self.rotations(x), self._curvature)
        apart = (self._laplacian @ x) / self._areas[:, None] - wanted
        return float(self._areas @ (apart**2).sum(axis=1))

    def least(self, start: Array, targets: Array) -> Array:
        """Vertices (n, 3) of least E_bend with the known ones at targets (r, 3), from a start."""
        x = start.copy()
        x[self.points] = targets
        for _ in range(ROUNDS):
            wanted = np.einsum("nij,nj->ni", self.rotations(x), self._curvature)
            right = (self._laplacian @ wanted)[self.free] - self._coupling @ targets
            found = np.column_stack([self._solve(column) for column in right.T])
            moved = float(np.abs(found - x[self.free]).max())
            x[self.free] = found
            if moved < SETTLED:
                return x
        raise ConvergenceError("bending", f"vertices still move by {moved:.2g} mm", "Give fewer marks")
