import igl
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.mesh.surfaces.barycentric import barycentric_weights
from handpipe.mesh.surfaces.distance import Distance, about, sample_points, surface_errors
from handpipe.mesh.surfaces.surface import Surface, concatenate

from .shapes import box, sphere


def box_distance(points, size):
    beyond = np.abs(points - size / 2) - size / 2
    return np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)


def test_signed_distance_of_a_box_is_exact_at_sides_edges_and_corners():
    size = np.array([4.0, 3.0, 2.0])
    points = np.random.default_rng(0).uniform(-3, 6, (5000, 3))
    signed, triangles, closest, normals = Distance(box(tuple(size))).signed(points)
    np.testing.assert_allclose(signed, box_distance(points, size), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(points - closest, axis=1), np.abs(signed), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    assert triangles.max() < 12


def test_signed_distance_of_a_sphere():
    points = np.random.default_rng(1).normal(size=(3000, 3)) * 8
    signed = Distance(sphere(10, 5)).signed(points)[0]
    assert np.abs(signed - (np.linalg.norm(points, axis=1) - 10)).max() < 4e-3


def test_signs_agree_with_libigl_on_a_shape_with_folds():
    shape = sphere(10, 4)
    waves = 1 + 0.3 * np.sin(shape.vertices[:, :1]) * np.cos(1.3 * shape.vertices[:, 1:2])
    shape = shape.moved(shape.vertices * waves)
    points = np.random.default_rng(2).normal(size=(3000, 3)) * 7
    expected = igl.signed_distance(
        points, shape.vertices, shape.triangles, igl.SIGNED_DISTANCE_TYPE_WINDING_NUMBER
    )[0]
    np.testing.assert_allclose(Distance(shape).signed(points)[0], expected, atol=1e-9)


def test_depths_inside_a_surface_that_cuts_itself():
    one, other = sphere(5, 4), sphere(5, 4)
    both = concatenate([one, other.moved(other.vertices + [6.0, 0, 0])])
    points = np.array([[0.9, 0, 0], [3.0, 0, 0], [-4.0, 0, 0], [-6.0, 0, 0], [12.0, 0, 0]])
    np.testing.assert_allclose(Distance(both).depths(points), [0.1, 2.0, 1.0, 0.0, 0.0], atol=0.02)
    assert Distance(both).signed(points[:1])[0] > 0  # by the nearest normal it would be outside


def test_by_windings_the_distance_to_a_surface_that_cuts_itself_has_no_jump():
    one, other = sphere(5, 4), sphere(5, 4)
    both = concatenate([one, other.moved(other.vertices + [6.0, 0, 0])])
    x = np.linspace(-7.0, 13.0, 2001)
    points = np.column_stack([x, np.full_like(x, 0.05), np.full_like(x, 0.03)])
    signed, _, closest, normals = Distance(both, by_winding=True).signed(points)
    to_each = [np.linalg.norm(points - [centre, 0, 0], axis=1) - 5.0 for centre in (0.0, 6.0)]
    true = np.abs(to_each).min(axis=0)
    inside = (x > -5.0) & (x < 11.0)
    np.testing.assert_allclose(signed, np.where(inside, -true, true), atol=0.02)
    step = x[1] - x[0]
    assert np.abs(np.diff(signed)).max() < step + 1e-9
    assert np.abs(np.diff(Distance(both).signed(points)[0])).max() > 1.0  # by normals it jumps
    away = np.abs(signed) > 1e-3
    outwards = np.einsum("ni,ni->n", points - closest, normals) / signed
    np.testing.assert_allclose(outwards[away], 1.0, atol=0.02)


@pytest.mark.parametrize("near", [0.0, 0.7])
def test_no_point_near_a_slender_body_that_lies_askew_is_missed(near):
    rod = sphere(1.0, 4).moved(sphere(1.0, 4).vertices * [10.0, 1.0, 2.0])
    turn = Rotation.from_rotvec([0.7, -0.4, 0.9]).as_matrix()
    askew = rod.moved(rod.vertices @ turn.T + [3.0, -2.0, 1.0])
    points = np.random.default_rng(0).uniform(-9, 12, (20000, 3))
    found = about(points, askew, near)
    closer = np.flatnonzero(igl.signed_distance(points, askew.vertices, askew.triangles)[0] < near)
    assert len(closer) > 80 and np.isin(closer, found).all()
    low, high = askew.box
    in_box = ((points > low - near) & (points < high + near)).all(axis=1).sum()
    assert len(found) < 0.4 * in_box
    assert (np.diff(found) > 0).all()


def test_no_points_give_no_distances():
    assert Distance(box()).depths(np.zeros((0, 3))).shape == (0,)
    assert Distance(box()).signed(np.zeros((0, 3)))[0].shape == (0,)


def test_samples_lie_evenly_on_the_surface():
    points = sample_points(box((4, 3, 2)), 20_000, seed=3)
    assert np.abs(box_distance(points, np.array([4.0, 3.0, 2.0]))).max() < 1e-12
    assert (points[:, 2] > 2 - 1e-9).mean() == pytest.approx(12 / 52, abs=0.02)


def test_errors_between_concentric_spheres():
    assert surface_errors(sphere(10, 3), sphere(9, 5)) == pytest.approx(1, abs=5e-3)
    assert surface_errors(sphere(10, 5), sphere(9, 5), samples=500) == pytest.approx(1, abs=1e-2)


def test_vertices_that_no_triangle_uses_are_no_error():
    far = Surface(np.concatenate([box().vertices, [[99.0, 0, 0]]]), box().triangles)
    assert surface_errors(far, box()).max() == 0


@pytest.mark.parametrize("spread", [0.3, 3.0, 30.0])
def test_closest_places_are_those_of_libigl_whatever_shape_the_order_comes_from(spread):
    shape = sphere(10, 4)
    waves = 1 + 0.3 * np.sin(shape.vertices[:, :1]) * np.cos(1.3 * shape.vertices[:, 1:2])
    folded = shape.moved(shape.vertices * waves)
    points = folded.vertices + spread * np.random.default_rng(3).normal(size=folded.vertices.shape)
    own = Surface(folded.vertices, folded.triangles)
    shape.tree()  # its order is that of the sphere
    distances, triangles, closest = Distance(folded).closest(points)
    squared, _, expected = igl.point_mesh_squared_distance(points, folded.vertices, folded.triangles)
    np.testing.assert_allclose(distances, np.sqrt(squared), rtol=1e-13)
    np.testing.assert_allclose(closest, expected, atol=1e-12)
    for a, b in zip((distances, triangles, closest), Distance(own).closest(points), strict=True):
        np.testing.assert_array_equal(a, b)


def test_weights_in_a_triangle_without_area_are_those_of_its_longest_edge() -> None:
    """Contours have such triangles where a grid point lies on the surface."""
    edge = np.array([[1.0, 2, 3], [4.0, 6, 3]])
    for third in (0, 1, None):  # at an end, or on the edge
        apex = edge.mean(axis=0) if third is None else edge[third]
        corners = np.array([[edge[0], apex, edge[1]], [apex, edge[1], edge[0]]])
        for share in (0.0, 0.3, 1.0):
            place = (1 - share) * edge[0] + share * edge[1]
            weights = barycentric_weights(np.tile(place, (2, 1)), corners)
            np.testing.assert_allclose(weights.sum(axis=1), 1.0)
            np.testing.assert_allclose(np.einsum("nk,nki->ni", weights, corners), [place, place])
    point = barycentric_weights(np.array([[1.0, 1, 1]]), np.ones((1, 3, 3)))
    np.testing.assert_allclose(point.sum(), 1.0)


@pytest.mark.parametrize("first", [True, False], ids=["lines first", "lines last"])
def test_triangles_without_area_leave_the_sides_of_a_box_as_they_are(first: bool) -> None:
    """Edges of a box are split on one side alone, and a triangle without area closes each gap."""
    box = trimesh.creation.box()
    vertices, whole, lines, split = [*np.asarray(box.vertices)], [], [], set()
    for a, b, c in np.asarray(box.faces):
        edge = frozenset((int(a), int(b)))
        if edge in split:
            whole.append((a, b, c))
            continue
        split.add(edge)
        middle = len(vertices)
        vertices.append((vertices[a] + vertices[b]) / 2)
        whole += [(a, middle, c), (middle, b, c)]
        lines.append((a, b, middle))
    surface = Surface(np.array(vertices), np.array(lines + whole if first else whole + lines))
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (5000, 3))
    within = (np.abs(points) < 0.5).all(axis=1)
    outside = np.linalg.norm(np.maximum(np.abs(points) - 0.5, 0.0), axis=1)
    expected = np.where(within, np.abs(points).max(axis=1) - 0.5, outside)
    assert surface.is_closed() and len(lines) > 5 and 100 < within.sum() < 2500
    np.testing.assert_allclose(Distance(surface).signed(points)[0], expected, atol=1e-12)


def test_ways_out_are_those_of_trimesh_and_end_where_they_leave():
    """A wavy ball, from inside and outside: of all hits of a ray, the first one out of it."""
    shape = sphere(10, 4)
    waves = 1 + 0.3 * np.sin(shape.vertices[:, :1]) * np.cos(1.3 * shape.vertices[:, 1:2])
    shape = shape.moved(shape.vertices * waves)
    random = np.random.default_rng(5)
    points, directions = random.normal(size=(500, 3)) * 6, random.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    mesh = trimesh.Trimesh(shape.vertices, shape.triangles, process=False)
    hits, rays, faces = mesh.ray.intersects_location(points, directions)
    leaves = np.einsum("ni,ni->n", mesh.face_normals[faces], directions[rays]) > 0
    expected = np.full(len(points), np.inf)
    np.minimum.at(expected, rays[leaves], np.linalg.norm(hits - points[rays], axis=1)[leaves])
    expected[expected > 12.0] = np.inf
    lengths, triangles, places, normals = Distance(shape).ways_out(points, directions, 12.0)
    np.testing.assert_allclose(lengths, expected, atol=1e-7)
    out = np.isfinite(lengths)
    assert 100 < out.sum() < 490
    np.testing.assert_allclose(places[out], points[out] + lengths[out, None] * directions[out], atol=1e-9)
    np.testing.assert_array_equal(places[~out], points[~out])
    np.testing.assert_array_equal(normals[~out], directions[~out])
    np.testing.assert_array_equal(triangles >= 0, out)
    facets = mesh.face_normals[triangles[out]]
    assert np.einsum("ni,ni->n", normals[out], facets).min() > 0.6
