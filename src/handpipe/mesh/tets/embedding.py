"""Points carried by a tetrahedral mesh through barycentric weights."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh


class Locator:
    """Finds the tets around points, by a tree that is built once.

    Parameters
    ----------
    mesh : TetMesh
        Mesh in mm.
    """

    def __init__(self, mesh: TetMesh) -> None:
        self.mesh = mesh
        self._tree = igl.AABB()
        self._tree.init(mesh.vertices, mesh.tets)

    def tets(self, points: Array) -> IntArray:
        """The tet (n,) around each of points (n, 3), -1 outside the mesh."""
        queries = np.ascontiguousarray(points, dtype=np.float64)
        found = igl.in_element(self.mesh.vertices, self.mesh.tets, queries, self._tree)
        return np.asarray(found, dtype=np.int64).reshape(-1)


def nearest_tets(points: Array, mesh: TetMesh) -> IntArray:
    """The tet around each point, or that of the nearest boundary face.

    Parameters
    ----------
    points : array (n, 3)
        Positions in mm.
    mesh : TetMesh
        Mesh in mm.

    Returns
    -------
    array (n,) of int
        Indices of tets.
    """
    found = Locator(mesh).tets(points)
    outside = found < 0
    if outside.any():
        faces, owners = mesh.boundary_faces()
        nearest = Distance(Surface(mesh.vertices, faces)).closest(points[outside])[1]
        found[outside] = owners[nearest]
    return found


@dataclass(frozen=True, eq=False)
class Embedding:
    """Points that the vertices of a tetrahedral mesh carry through barycentric weights.

    Parameters
    ----------
    cells : array (n, 4) of int
        Vertices of each point's tet.
    weights : array (n, 4)
        Weights of these vertices, which sum to 1; negative for a point outside its tet.
    """

    cells: IntArray
    weights: Array

    @staticmethod
    def embed(points: Array, mesh: TetMesh) -> Embedding:
        """Embed points (n, 3) in the tet around each, or in the tet of the nearest boundary face."""
        points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        return Embedding.in_tets(points, mesh, nearest_tets(points, mesh))

    @staticmethod
    def in_tets(points: Array, mesh: TetMesh, tets: IntArray) -> Embedding:
        """Embed each of points (n, 3) in the tet of index tets (n,), inside of it or not."""
        cells = mesh.tets[tets]
        corners = mesh.vertices[cells]
        edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
        last = np.linalg.solve(edges, (points - corners[:, 0])[:, :, None])[:, :, 0]
        return Embedding(cells, np.column_stack([1 - last.sum(axis=1), last]))

    def chosen(self, ids: IntArray) -> Embedding:
        """The embedding of some of the points, by their indices (k,)."""
        return Embedding(self.cells[ids], self.weights[ids])

    def drawn_in(self) -> Embedding:
        """The same points, but those outside their tets moved to the border: no weight is negative."""
        weights = np.maximum(self.weights, 0.0)
        return Embedding(self.cells, weights / weights.sum(axis=1, keepdims=True))

    def __call__(self, vertices: Array) -> Array:
        """The points (n, 3) carried by vertices (N, 3), or any other field (N, d) interpolated to them."""
        return np.einsum("nc,ncd->nd", self.weights, vertices[self.cells])

    def matrix(self, n_vertices: int) -> sparse.csr_matrix:
        """The same map as a matrix (n, N)."""
        n = len(self.cells)
        rows = np.repeat(np.arange(n), 4)
        return sparse.csr_matrix((self.weights.ravel(), (rows, self.cells.ravel())), shape=(n, n_vertices))

    def matrix3(self, n_vertices: int) -> sparse.csr_matrix:
        """The same map on flattened positions, a matrix (3 n, 3 N)."""
        return sparse.kron(self.matrix(n_vertices), sparse.eye(3), format="csr")
