"""Sparse operators of linear tetrahedra and triangles."""

from __future__ import annotations

import igl
import numpy as np
from numba import njit
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import FACES, TetMesh


def rest_inverses(vertices: Array, tets: IntArray) -> Array:
    """Inverses (m, 3, 3) of the matrices whose columns are each tet's edges from its first corner."""
    corners = vertices[tets]
    return np.asarray(np.linalg.inv(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)), dtype=np.float64)


def shape_gradients(vertices: Array, tets: IntArray) -> Array:
    """Gradients of the linear shape functions of tets.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm.
    tets : array (m, 4) of int
        Vertices of each tet.

    Returns
    -------
    array (m, 4, 3)
        Gradients in 1/mm, one for each corner.
    """
    last = rest_inverses(vertices, tets)
    return np.concatenate([-last.sum(axis=1, keepdims=True), last], axis=1)


def dirichlet_matrix(tets: IntArray, gradients: Array, volumes: Array, count: int) -> sparse.csr_matrix:
    """The matrix of the Dirichlet energy, one half of the integral of |grad u|^2.

    A field u is harmonic at the vertices where the product of the matrix and u is zero.

    Parameters
    ----------
    tets : array (m, k) of int
        Vertices of each cell: k is 4 for tets, 3 for triangles.
    gradients : array (m, k, 3)
        Gradients of the shape functions in 1/mm.
    volumes : array (m,)
        Volumes of the cells in mm^3, or areas in mm^2.
    count : int
        Number n of vertices.

    Returns
    -------
    sparse matrix (n, n)
        Symmetric, positive semi-definite, row sums zero; in mm, or without unit for triangles.
    """
    corners = tets.shape[1]
    entries = np.einsum("e,eak,ebk->eab", volumes, gradients, gradients)
    rows = np.repeat(tets, corners, axis=1).ravel()
    columns = np.tile(tets, (1, corners)).ravel()
    return sparse.csr_matrix((entries.ravel(), (rows, columns)), shape=(count, count))


def gradient_operator(vertices: Array, tets: IntArray) -> sparse.csr_matrix:
    """The matrix G that takes positions to deformation gradients, F = G x.

    Parameters
    ----------
    vertices : array (n, 3)
        Rest positions in mm.
    tets : array (m, 4) of int
        Vertices of each tet.

    Returns
    -------
    sparse matrix (9 m, 3 n)
        Takes flattened positions (3 n,) in mm to the deformation gradients of all tets, each row-major.
    """
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
    """Pairs of tets that share a face.

    Parameters
    ----------
    tets : array (m, 4) of int
        Vertices of each tet.

    Returns
    -------
    array (p, 2) of int
        Indices of the two tets of each pair; each pair once.
    """
    faces = np.sort(tets[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(faces.T[::-1])
    same = (faces[order[1:]] == faces[order[:-1]]).all(axis=1)
    return np.stack([order[:-1][same], order[1:][same]], axis=1) // 4


def tet_pieces(count: int, pairs: IntArray) -> IntArray:
    """Pieces that tets form, which are connected by faces.

    Pieces that share an edge or a vertex alone turn about it as about a hinge, without resistance.

    Parameters
    ----------
    count : int
        Number m of tets.
    pairs : array (p, 2) of int
        Pairs of `tet_neighbours`, all or some.

    Returns
    -------
    array (m,) of int
        Number of each tet's piece, from 0.
    """
    graph = sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def tet_laplacian(tets: IntArray) -> sparse.csr_matrix:
    """The graph Laplacian of tets, of which two are neighbours if they share a face.

    Parameters
    ----------
    tets : array (m, 4) of int
        Vertices of each tet.

    Returns
    -------
    sparse matrix (m, m)
        Number of neighbours on the diagonal, -1 for each pair of neighbours.

    References
    ----------
    Wang 2021 App. A.
    """
    m = len(tets)
    i, j = tet_neighbours(tets).T
    ones = np.ones(len(i))
    adjacency = sparse.coo_matrix((ones, (i, j)), shape=(m, m))
    adjacency = (adjacency + adjacency.T).tocsr()
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return (sparse.diags(degree) - adjacency).tocsr()


def cotangent_laplacian(vertices: Array, triangles: IntArray) -> sparse.csr_matrix:
    """The cotangent Laplacian of a surface, not divided by a mass.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm.
    triangles : array (k, 3) of int
        Vertices of each triangle.

    Returns
    -------
    sparse matrix (n, n)
        Symmetric, positive semi-definite, row sums zero; without unit.
    """
    return (-igl.cotmatrix(vertices, triangles)).tocsr()


def mass_lumped(vertices: Array, triangles: IntArray) -> Array:
    """The area that belongs to each vertex: a third of that of its triangles.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm.
    triangles : array (k, 3) of int
        Vertices of each triangle.

    Returns
    -------
    array (n,)
        Areas in mm^2.
    """
    return _gather(triangles, Surface(vertices, triangles).triangle_areas() / 3, len(vertices))


def vertex_volumes(mesh: TetMesh) -> Array:
    """The volume (n,) in mm^3 that belongs to each vertex: a quarter of that of its tets."""
    return _gather(mesh.tets, mesh.volumes() / 4, len(mesh.vertices))


def _gather(cells: IntArray, shares: Array, n: int) -> Array:
    sums = np.zeros(n)
    np.add.at(sums, cells, shares[:, None])
    return sums
