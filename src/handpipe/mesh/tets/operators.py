"""Sparse operators of linear tetrahedra and triangles."""

from __future__ import annotations

import igl
import numpy as np
from numba import njit
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import FACES, TetMesh


def rest_inverses(vertices: Array, tets: IntArray) -> Array:
    """Inverses (m, 3, 3) of the matrices whose columns are each tet's edges from its first corner."""
    corners = vertices[tets]
    return np.asarray(np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)), dtype=np.float64)


def shape_gradients(vertices: Array, tets: IntArray) -> Array:
    """Gradients (m, 4, 3) in 1/mm of the four linear shape functions."""
    last = rest_inverses(vertices, tets)
    return np.concatenate([-last.sum(axis=1, keepdims=True), last], axis=1)


def dirichlet_matrix(tets: IntArray, gradients: Array, volumes: Array, count: int) -> sparse.csr_matrix:
    """Matrix (n, n) of the energy 1/2 of |grad u|^2 of fields over cells (m, k) of n = `count` vertices.

    gradients (m, k, 3): of the shape functions; volumes (m,). Where it has no residual a field is harmonic.
    """
    corners = tets.shape[1]
    entries = np.einsum("e,eak,ebk->eab", volumes, gradients, gradients)
    rows = np.repeat(tets, corners, axis=1).ravel()
    columns = np.tile(tets, (1, corners)).ravel()
    return sparse.csr_matrix((entries.ravel(), (rows, columns)), shape=(count, count))


def gradient_operator(vertices: Array, tets: IntArray) -> sparse.csr_matrix:
    """Matrix (9 m, 3 n) that takes positions x (3 n,) to deformation gradients F = G x, row-major."""
    gradients = shape_gradients(vertices, tets)
    m = len(tets)
    element, row, column, corner = np.meshgrid(np.arange(m), range(3), range(3), range(4), indexing="ij")
    rows = 9 * element + 3 * row + column
    columns = 3 * tets[element, corner] + row
    values = gradients[element, corner, column]
    shape = (9 * m, 3 * len(vertices))
    return sparse.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


@njit(cache=True)
def deformation_gradients(rest_inverse: Array, x: Array, tets: IntArray) -> Array:
    """Deformation gradients (m, 3, 3) of positions x (n, 3), from `rest_inverses` (m, 3, 3)."""
    out = np.empty((len(tets), 3, 3))
    for e in range(len(tets)):
        for i in range(3):
            origin = x[tets[e, 0], i]
            d0 = x[tets[e, 1], i] - origin
            d1 = x[tets[e, 2], i] - origin
            d2 = x[tets[e, 3], i] - origin
            for j in range(3):
                inverse = rest_inverse[e]
                out[e, i, j] = d0 * inverse[0, j] + d1 * inverse[1, j] + d2 * inverse[2, j]
    return out


def tet_neighbours(tets: IntArray) -> IntArray:
    """Pairs (p, 2) of tets that share a face, each pair once."""
    faces = np.sort(tets[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T[::-1])
    same = (faces[order[1:]] == faces[order[:-1]]).all(axis=1)
    return np.stack([order[:-1][same], order[1:][same]], axis=1) // 4


def tet_laplacian(tets: IntArray) -> sparse.csr_matrix:
    """Graph Laplacian (m, m) over tets that share a face (Wang 2021 App. A).

    It has the degree on the diagonal and -1 off it.
    """
    m = len(tets)
    i, j = tet_neighbours(tets).T
    ones = np.ones(len(i))
    adjacency = sparse.coo_matrix((ones, (i, j)), shape=(m, m))
    adjacency = (adjacency + adjacency.T).tocsr()
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return (sparse.diags(degree) - adjacency).tocsr()


def cotangent_laplacian(vertices: Array, triangles: IntArray) -> sparse.csr_matrix:
    """Cotangent Laplacian (n, n) without mass: symmetric, positive semi-definite, row sums zero."""
    return (-igl.cotmatrix(vertices, triangles)).tocsr()


def mass_lumped(vertices: Array, triangles: IntArray) -> Array:
    """Area (n,) in mm^2 of each vertex: a third of its triangles."""
    return _gather(triangles, Surface(vertices, triangles).triangle_areas() / 3, len(vertices))


def vertex_volumes(mesh: TetMesh) -> Array:
    """Volume (n,) in mm^3 of each vertex: a quarter of its tets."""
    return _gather(mesh.tets, mesh.volumes() / 4, len(mesh.vertices))


def _gather(cells: IntArray, shares: Array, n: int) -> Array:
    sums = np.zeros(n)
    np.add.at(sums, cells, shares[:, None])
    return sums
