import numpy as np
import pytest

from handpipe.core.errors import InputError
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.files import read_surface, write_surface
from handpipe.mesh.surfaces.surface import Surface, concatenate, each_moved, require_closed

from .shapes import box, sphere


def test_box_has_its_measures():
    shape = box((4, 3, 2))
    assert shape.is_closed()
    assert shape.volume() == pytest.approx(24)
    assert shape.area() == pytest.approx(52)
    assert shape.centroid() == pytest.approx([2, 1.5, 1])
    assert shape.flipped().volume() == pytest.approx(-24)
    assert len(shape.edges()) == 18  # Euler: 8 - 18 + 12 = 2


def test_centroid_is_of_the_volume_and_not_of_the_vertices():
    tetrahedron = Surface(
        np.array([[0, 0, 0], [4, 0, 0], [0, 8, 0], [0, 0, 12.0]]),
        np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
    )
    dense = concatenate([tetrahedron, Surface(np.tile([[4.0, 0, 0]], (5, 1)), np.zeros((0, 3)))])
    assert dense.centroid() == pytest.approx([1, 2, 3])


def test_sphere_approaches_its_volume_quadratically():
    errors = [1 - sphere(10, level).volume() / (4000 * np.pi / 3) for level in (2, 3, 4)]
    assert errors[2] < 3e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)


def test_vertex_normals_of_a_sphere_are_radial():
    shape = sphere(5, 3)
    assert np.einsum("ij,ij->i", shape.vertex_normals(), shape.vertices / 5).min() > 0.9999


def test_normal_of_a_box_corner_does_not_depend_on_how_its_sides_are_cut():
    assert box((1, 1, 1)).vertex_normals()[0] == pytest.approx(-np.ones(3) / np.sqrt(3))


def test_largest_component():
    pair = concatenate([sphere(2, 2), sphere(5, 2).moved(sphere(5, 2).vertices + 20)])
    assert len(pair.components()) == 2
    assert pair.largest_component().volume() == pytest.approx(sphere(5, 2).volume())


@pytest.mark.parametrize("suffix", ["ply", "obj"])
def test_files_keep_vertices_and_their_order(tmp_path, suffix):
    shape = sphere(7, 2)
    write_surface(tmp_path / f"a.{suffix}", shape)
    again = read_surface(tmp_path / f"a.{suffix}", closed=True)
    np.testing.assert_allclose(again.vertices, shape.vertices, atol=1e-12)
    np.testing.assert_array_equal(again.triangles, shape.triangles)


def test_stl_is_merged_to_a_closed_surface(tmp_path):
    write_surface(tmp_path / "a.stl", sphere(7, 2))
    again = read_surface(tmp_path / "a.stl", closed=True)
    assert again.volume() == pytest.approx(sphere(7, 2).volume(), rel=1e-5)


def test_a_closed_surface_is_turned_outwards(tmp_path):
    write_surface(tmp_path / "a.ply", box().flipped())
    assert read_surface(tmp_path / "a.ply").volume() == pytest.approx(-24)
    assert read_surface(tmp_path / "a.ply", closed=True).volume() == pytest.approx(24)


def test_quads_are_cut_into_triangles(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nf 1 2 3 4\n")
    assert read_surface(tmp_path / "a.obj").area() == pytest.approx(6)


def refusal(path, **options):
    with pytest.raises(InputError) as caught:
        read_surface(path, **options)
    assert str(path) in str(caught.value)
    return caught.value


def test_missing_file_is_named(tmp_path):
    assert "does not exist" in refusal(tmp_path / "none.ply").problem


def test_unknown_and_malformed_files_are_named(tmp_path):
    (tmp_path / "a.txt").write_text("hello")
    assert refusal(tmp_path / "a.txt").field == "file"
    (tmp_path / "a.ply").write_text("hello")
    assert refusal(tmp_path / "a.ply").field == "content"


def test_points_alone_are_refused(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 2 0 0\nv 2 3 0\n")
    assert refusal(tmp_path / "a.obj").field == "triangles"


def test_nan_is_refused(tmp_path):
    vertices = box().vertices.copy()
    vertices[5, 1] = np.nan
    write_surface(tmp_path / "a.ply", box().moved(vertices))
    error = refusal(tmp_path / "a.ply")
    assert error.field == "vertices"
    assert "NaN" in error.problem
    assert "vertex 5" in error.problem


def test_metres_are_refused(tmp_path):
    write_surface(tmp_path / "a.ply", box((0.1, 0.02, 0.02)))
    error = refusal(tmp_path / "a.ply")
    assert (error.field, "metres" in error.problem, "1000" in error.remedy) == ("units", True, True)


def test_an_open_surface_is_refused_where_a_closed_one_is_asked(tmp_path):
    whole = box()
    write_surface(tmp_path / "a.ply", Surface(whole.vertices, whole.triangles[1:]))
    assert len(read_surface(tmp_path / "a.ply").triangles) == 11
    assert "3 boundary edges" in refusal(tmp_path / "a.ply", closed=True).problem


def test_a_surface_whose_triangles_disagree_is_not_closed():
    turned = box().triangles.copy()
    turned[3] = turned[3, ::-1]
    with pytest.raises(InputError, match="opposite"):
        require_closed(Surface(box().vertices, turned), "memory")


def test_surfaces_move_each_by_its_own_transform():
    left, right = box((1, 1, 1)), box((2, 2, 2))
    quarter = RigidTransform(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([5.0, 0, 0]))
    shift = RigidTransform(np.eye(3), np.array([0.0, 0, 3]))
    moved = each_moved({"a": left, "b": right}, {"b": shift, "a": quarter, "other": shift})
    assert list(moved) == ["a", "b"]
    np.testing.assert_allclose(moved["a"].centroid(), [5 - 0.5, 0.5, 0.5])
    np.testing.assert_allclose(moved["b"].centroid(), [1, 1, 4])
