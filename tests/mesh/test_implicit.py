import numpy as np
import pytest
import trimesh

from handpipe.core.errors import HandpipeError, InputError
from handpipe.mesh.generation.implicit import Grid, isosurface, smooth_minimum, union_surface
from handpipe.mesh.generation.remeshing import relax, remesh
from handpipe.mesh.surfaces.distance import surface_errors
from handpipe.mesh.surfaces.surface import Surface

from .shapes import box, folded_ball, smallest_angles, sphere


def ellipsoid(spacing=0.5):
    grid = Grid.around(np.array([[-10.0, -6, -5], [10, 6, 5]]), 1, spacing)
    return isosurface(np.linalg.norm(grid.points() / [10, 6, 5], axis=1) - 1, grid)


def test_a_grid_covers_its_points_and_orders_its_own():
    grid = Grid.around(np.array([[0.3, 1, 2], [4, 5, 6.1]]), 0.5, 0.25)
    points = grid.points()
    assert (points.min(axis=0) <= [-0.2, 0.5, 1.5]).all()
    assert (points.max(axis=0) >= [4.5, 5.5, 6.6]).all()
    assert points.reshape(*grid.shape, 3)[2, 3, 4] == pytest.approx(grid.origin + 0.25 * np.array([2, 3, 4]))


def test_isosurface_has_the_volume_and_faces_outwards():
    shape = ellipsoid()
    assert shape.is_closed()
    assert shape.volume() == pytest.approx(4 / 3 * np.pi * 300, rel=5e-3)
    assert (np.einsum("ij,ij->i", shape.vertex_normals(), shape.vertices) > 0).all()


def test_isosurface_is_closed_at_the_border_of_the_grid():
    grid = Grid(np.zeros(3), 1.0, (6, 6, 6))
    shape = isosurface(grid.points()[:, 0] - 2.5, grid)
    assert shape.is_closed()
    assert shape.volume() == pytest.approx(3 * 6 * 6, rel=0.08)
    assert shape.vertices.min() == pytest.approx(-0.5)


def test_isosurface_of_nothing_is_refused():
    grid = Grid(np.zeros(3), 1.0, (4, 4, 4))
    with pytest.raises(HandpipeError, match="no value below"):
        isosurface(np.ones(64), grid)


@pytest.mark.parametrize("edge_length", [0.5, 1.0, 1.5])
def test_remeshing_gives_good_triangles_on_the_same_surface(edge_length):
    shape = ellipsoid()
    result = remesh(shape, edge_length)
    angles = smallest_angles(result)
    assert result.is_closed()
    assert len(result.vertices) - len(result.edges()) + len(result.triangles) == 2
    assert angles.min() > 20
    assert angles.mean() > 45
    assert np.median(result.edge_lengths()) == pytest.approx(edge_length, rel=0.1)
    assert result.edge_lengths().max() < 1.6 * edge_length
    assert surface_errors(result, shape).max() < 1e-9
    chord = (1.2 * edge_length) ** 2 / (
        8 * 2.5
    ) + 0.02  # curvature radius 2.5 mm at the tip; the input's steps
    assert surface_errors(shape, result).max() < chord


def test_remeshing_refines_very_coarse_triangles():
    result = remesh(box((8, 6, 4)), 0.2)
    assert result.edge_lengths().max() < 0.35
    assert smallest_angles(result).min() > 20
    assert result.volume() == pytest.approx(192, rel=0.01)


def test_remeshing_is_deterministic():
    first, second = remesh(ellipsoid(), 0.8), remesh(ellipsoid(), 0.8)
    assert np.array_equal(first.vertices, second.vertices)
    assert np.array_equal(first.triangles, second.triangles)


def test_remeshing_refuses_an_open_surface():
    with pytest.raises(InputError, match="boundary edges"):
        remesh(Surface(box().vertices, box().triangles[1:]), 1.0)


def test_relaxing_stays_on_the_surface_and_betters_the_triangles():
    shape = ellipsoid()

    def project(points):
        return points / np.linalg.norm(points / [10, 6, 5], axis=1, keepdims=True)

    result = relax(shape, project, 20)
    assert np.linalg.norm(result.vertices / [10, 6, 5], axis=1) == pytest.approx(1)
    assert np.percentile(smallest_angles(result), 5) > 3 * np.percentile(smallest_angles(shape), 5)


def test_union_of_two_spheres_has_the_volume_of_their_lens_removed():
    ball = sphere(5, 4)
    other = ball.moved(ball.vertices + [6, 0, 0])
    lens = np.pi * (4 * 5 + 6) * (2 * 5 - 6) ** 2 / 12
    union = union_surface([ball, other], 0.4)
    assert union.is_closed()
    assert union.volume() == pytest.approx(2 * 500 / 3 * np.pi - lens, rel=0.01)


def test_a_body_that_folds_through_itself_grows_no_horn():
    both = [folded_ball(), sphere(2.0, 3).moved(sphere(2.0, 3).vertices - [0.0, 0.0, 18.0])]
    found = union_surface(both, 0.5)
    apart = trimesh.Trimesh(found.vertices, found.triangles, process=False).split()
    assert len(apart) == 2
    upper = max(apart, key=lambda part: part.volume)
    assert np.linalg.norm(upper.vertices, axis=1).max() < 5.3


def test_offset_grows_the_union():
    union = union_surface([sphere(5, 4)], 0.4, 0.7)
    assert np.linalg.norm(union.vertices, axis=1) == pytest.approx(5.7, abs=0.02)


def test_smooth_minimum_rounds_only_where_both_meet():
    a, b = np.array([1.0, 1.0, 1.0]), np.array([1.0, 1.25, 1.5])
    assert smooth_minimum(a, b, 0.5) == pytest.approx([1 - 0.125, 1 - 0.125 / 4, 1])
    assert smooth_minimum(a, b, 0.0) == pytest.approx(np.minimum(a, b))
