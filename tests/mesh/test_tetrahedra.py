import numpy as np
import pytest

from handpipe.core.errors import InputError
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
