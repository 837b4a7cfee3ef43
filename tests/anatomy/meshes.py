"""Meshes and checks of the anatomy's tests."""

import numpy as np
import skfem

from handpipe.mesh.surfaces.surface import directed_edges
from handpipe.mesh.tets.tetrahedra import EDGES, FACES, TetMesh


def box(shape: tuple[int, int, int], size: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> TetMesh:
    """A box from the origin, cut into shape[0] x shape[1] x shape[2] cells of six tets."""
    axes = [np.linspace(0, s, n + 1) for n, s in zip(shape, size, strict=True)]
    mesh = skfem.MeshTet.init_tensor(*axes)
    return positive(mesh.p.T, mesh.t.T)


def positive(vertices: np.ndarray, tets: np.ndarray) -> TetMesh:
    """The mesh with every tet turned to a positive volume."""
    tets = tets.astype(np.int64).copy()
    turned = TetMesh(vertices, tets).volumes() < 0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return TetMesh(vertices, tets)


def require_conforming(mesh: TetMesh, boundary_area: float) -> None:
    """Each facet has at most two tets, on different sides; those of one tet make up the domain's boundary.

    A vertex in the middle of a neighbour's edge or face would leave facets there with one tet, whose area
    would be too much.
    """
    faces = mesh.tets[:, FACES].reshape(-1, 3)
    _, inverse, counts = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
    assert counts.max() <= 2
    first = np.argmin(faces, axis=1)
    turned = np.take_along_axis(faces, (first[:, None] + [0, 1, 2]) % 3, axis=1)
    sides = np.where(turned[:, 1] < turned[:, 2], 1, -1)
    assert (np.bincount(inverse.reshape(-1), sides)[counts == 2] == 0).all()
    np.testing.assert_allclose(mesh.boundary().area(), boundary_area, rtol=1e-9)


def require_closed_labels(mesh: TetMesh, labels: np.ndarray) -> None:
    """The surface of every label runs along each directed edge as often forth as back."""
    for label in np.unique(labels):
        faces = TetMesh(mesh.vertices, mesh.tets[labels == label]).boundary_faces()[0]
        directed = directed_edges(faces)
        n = len(mesh.vertices)
        forth, times = np.unique(directed @ [n, 1], return_counts=True)
        back, others = np.unique(directed @ [1, n], return_counts=True)
        assert np.array_equal(forth, back) and np.array_equal(times, others)


def euler_characteristic(mesh: TetMesh) -> int:
    """Vertices - edges + faces - tets."""
    count = [len(np.unique(mesh.tets))]
    for columns, size in ((EDGES, 2), (FACES, 3)):
        cells = np.sort(mesh.tets[:, columns].reshape(-1, size), axis=1)
        count.append(len(np.unique(cells, axis=0)))
    return count[0] - count[1] + count[2] - len(mesh.tets)
