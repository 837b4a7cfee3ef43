"""Points carried by surfaces."""

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.anchors import Anchors
from handpipe.mesh.surfaces.surface import Surface

from .shapes import sphere

BALL = sphere(5.0, 4)


def _points(low, high, count=60):
    rng = np.random.default_rng(0)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * rng.uniform(low, high, (count, 1))


def test_points_within_faces_are_where_they_were():
    # Facets of a sphere are seen straight on from inside: every closest place is within a face.
    points = _points(4.0, 4.9)
    np.testing.assert_allclose(Anchors.attach(points, BALL)(BALL.vertices), points, atol=1e-9)


def test_a_rigid_motion_of_the_surface_is_one_of_the_points():
    motion = RigidTransform(Rotation.from_rotvec([0.4, -1.2, 0.3]).as_matrix(), np.array([7.0, 1.0, -2.0]))
    anchors = Anchors.attach(_points(4.0, 6.0), BALL)
    np.testing.assert_allclose(anchors(motion(BALL.vertices)), motion(anchors(BALL.vertices)), atol=1e-9)


def test_stretching_along_the_surface_keeps_heights():
    anchors = Anchors.attach(_points(5.5, 7.0), BALL)
    stretched = BALL.vertices * [1.5, 1.0, 0.8]
    lifted, feet = anchors(stretched), anchors.feet(stretched)
    np.testing.assert_allclose(
        np.einsum("ni,ni->n", lifted - feet, anchors.normals(stretched)), anchors.heights
    )
    assert np.abs(np.linalg.norm(lifted - feet, axis=1) - np.abs(anchors.heights)).max() < 1e-9
    np.testing.assert_allclose(feet, anchors.feet(BALL.vertices) * [1.5, 1.0, 0.8])


def test_feet_are_closest_places():
    points = _points(6.0, 8.0)
    feet = Anchors.attach(points, BALL).feet(BALL.vertices)
    radial = points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(feet, 5.0 * radial, atol=0.1)


def test_triangles_without_area_carry_no_point():
    """A triangle is cut in two at the middle of an edge, with a sliver without area along that edge."""
    vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [2, 0, 0], [2, -4, 0]])
    sliver = [0, 3, 1]  # igl finds the first of triangles that are equally near
    surface = Surface(vertices, np.array([sliver, [0, 1, 2], [0, 4, 3], [3, 4, 1]]))
    points = np.array([[1.0, 0.0, 0.5], [3.0, 0.0, -0.5], [2.0, 0.0, 0.0]])
    anchors = Anchors.attach(points, surface)
    np.testing.assert_allclose(anchors(vertices), points, atol=1e-12)
    motion = RigidTransform(Rotation.from_rotvec([0.4, -1.2, 0.3]).as_matrix(), np.array([7.0, 1.0, -2.0]))
    np.testing.assert_allclose(anchors(motion(vertices)), motion(points), atol=1e-12)
