"""Planes of contact on bodies that are thinner than a point may be deep."""

import numpy as np
import pytest

from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.planes import touching_planes

from .shapes import box, sphere

BALL = sphere(2.0, 4)
AT_BALL = Distance(BALL)


def _directions(count, seed=0):
    v = np.random.default_rng(seed).normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


@pytest.mark.parametrize("radius", [2.5, 2.0, 1.0])
def test_places_are_closest_places_on_a_sphere(radius):
    sides = _directions(50)
    places, normals = touching_planes(radius * sides, sides, np.zeros(50, int), {0: AT_BALL})
    np.testing.assert_allclose(places, 2.0 * sides, atol=0.04)
    assert np.einsum("ni,ni->n", normals, sides).min() > 0.99


def test_a_point_beyond_the_middle_comes_out_on_its_own_side():
    sides = _directions(50)
    places, normals = touching_planes(-1.0 * sides, sides, np.zeros(50, int), {0: AT_BALL})
    assert np.einsum("ni,ni->n", normals, sides).min() > 0.5
    assert np.einsum("ni,ni->n", places, sides).min() > 1.5


def test_a_plane_turns_without_a_jump_as_a_point_moves_through_a_thin_body():
    """Along a line through a tube the far side comes nearest: the plane must not leap to the near one."""
    tube = sphere(1.0, 5)
    tube = Distance(tube.moved(tube.vertices * [1.0, 1.0, 10.0]))
    way = np.column_stack([np.full(4001, 0.2), np.linspace(0.97, -0.6, 4001), np.linspace(0, 0.3, 4001)])
    for tilt in np.radians([0.0, 40.0, 80.0]):  # of the point's own side from the surface's normal
        sides = np.tile([np.sin(tilt), np.cos(tilt), 0.0], (len(way), 1))
        places, normals = touching_planes(way, sides, np.zeros(len(way), int), {0: tube})
        depths = np.einsum("ni,ni->n", places - way, normals)
        assert np.abs(np.diff(depths)).max() < 0.05
        assert np.einsum("ni,ni->n", normals[1:], normals[:-1]).min() > np.cos(np.radians(4.0))
        assert np.einsum("ni,ni->n", normals, sides).min() > 0.1


def test_a_point_that_passes_into_a_body_at_a_grazing_side_keeps_its_plane():
    sides = np.array([[1.0, 0.0, 0.0]] * 2)
    angle = np.radians(75.0)  # between its side and the surface's normal
    out = np.array([np.cos(angle), np.sin(angle), 0.0])
    points = np.array([2.01 * out, 1.99 * out])
    places, normals = touching_planes(points, sides, np.zeros(2, int), {0: AT_BALL})
    assert normals[0] @ normals[1] > np.cos(np.radians(2.0))
    assert np.linalg.norm(places[0] - places[1]) < 0.1


def test_bodies_are_told_apart():
    other = BALL.moved(BALL.vertices + [10.0, 0, 0])
    sides = _directions(40)
    body = np.arange(40) % 2
    centres = np.array([[0.0, 0, 0], [10.0, 0, 0]])[body]
    places, _ = touching_planes(centres + 1.5 * sides, sides, body, {0: AT_BALL, 1: Distance(other)})
    np.testing.assert_allclose(places, centres + 2.0 * sides, atol=0.04)


def test_a_point_that_finds_no_way_out_is_left_free():
    point, side = np.array([[10.0, 1.0, 10.0]]), np.array([[0.0, 0.8, 0.6]])
    places, normals = touching_planes(point, side, np.zeros(1, int), {0: Distance(box((20.0, 20.0, 20.0)))})
    np.testing.assert_array_equal(places, point)
    np.testing.assert_array_equal(normals, side)
