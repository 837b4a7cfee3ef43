from pathlib import Path

import meshio
import numpy as np
import pytest

from handpipe.core.errors import InputError
from handpipe.mesh.tets.tet_files import read_tets
from handpipe.mesh.tets.tetrahedra import TetMesh

from .shapes import box_tets

REGULAR = TetMesh(np.array([[1, 1, 1], [-1, 1, -1], [1, -1, -1], [-1, -1, 1.0]]), np.array([[0, 1, 2, 3]]))


def test_a_regular_tet_has_its_measures():
    mesh = REGULAR.checked("memory")
    assert mesh.volumes() == pytest.approx([8 / 3])
    assert mesh.dihedral_angles() == pytest.approx(np.full((1, 6), np.degrees(np.arccos(1 / 3))))
    assert mesh.smallest_dihedral() == pytest.approx(70.5288, abs=1e-4)


def test_the_boundary_encloses_the_tets():
    mesh = box_tets(3)
    boundary = mesh.boundary()
    assert boundary.is_closed()
    assert boundary.volume() == pytest.approx(mesh.volumes().sum()) == pytest.approx(1)
    assert boundary.area() == pytest.approx(6)
    assert len(mesh.boundary_vertices()) == 4**3 - 2**3
    faces, owners = mesh.boundary_faces()
    assert all(np.isin(face, tet).all() for face, tet in zip(faces, mesh.tets[owners], strict=True))


def test_inverted_tets_are_counted_and_named():
    mesh = box_tets(2)
    tets = mesh.tets.copy()
    tets[[7, 11]] = tets[[7, 11]][:, [1, 0, 2, 3]]
    with pytest.raises(InputError, match=r"muscle.h5: tets: 2 of 48 .* tet 7"):
        TetMesh(mesh.vertices, tets).checked("muscle.h5")


def test_nan_and_dangling_corners_are_refused():
    with pytest.raises(InputError, match="NaN"):
        TetMesh(REGULAR.vertices * np.nan, REGULAR.tets).checked("memory")
    with pytest.raises(InputError, match="do not exist"):
        TetMesh(REGULAR.vertices, REGULAR.tets + 1).checked("memory")


@pytest.mark.parametrize("shared", [1, 2])
def test_a_file_of_parts_that_hang_together_at_a_vertex_or_an_edge_is_refused(
    tmp_path: Path, shared: int
) -> None:
    mesh, path = box_tets(2), tmp_path / "hinged.vtk"
    vertices = 20.0 * mesh.vertices
    edge = mesh.tets[0][:shared]
    beside = vertices[edge[0]] + [[-30.0, -3, -5], [-7, -30, -2], [-4, -9, -30]]
    added = np.concatenate([edge, len(vertices) + np.arange(4 - shared)])
    points = np.vstack([vertices, beside[: 4 - shared]])
    if np.linalg.det(points[added[1:]] - points[added[0]]) < 0:
        added[-2:] = added[:-3:-1]
    meshio.write(path, meshio.Mesh(points, [("tetra", np.vstack([mesh.tets, added]))]))
    with pytest.raises(InputError, match=r"in 2 parts that share no face, of 48, 1 tets"):
        read_tets(path)
    meshio.write(path, meshio.Mesh(vertices, [("tetra", mesh.tets)]))
    assert len(read_tets(path).tets) == 48
