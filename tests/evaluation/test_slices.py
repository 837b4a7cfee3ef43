"""Slices of a sphere, in grey values and as contours."""

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from handpipe.evaluation.slices import (
    Contours,
    Plane,
    draw_slice,
    sagittal_plane,
    sample_plane,
    section,
    transversal_plane,
)
from handpipe.mesh.surfaces.surface import Surface

RADIUS, HEIGHT = 6.0, 2.5


@pytest.fixture
def ball() -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=RADIUS)
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64))


def tilted(height: float) -> Plane:
    axes = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return Plane(height * axes[:, 2], axes[:, 0], axes[:, 1])


def test_contour_of_a_sphere_is_a_circle_of_the_right_radius(ball):
    segments = section(ball, tilted(HEIGHT))
    expected = np.sqrt(RADIUS**2 - HEIGHT**2)
    np.testing.assert_allclose(np.linalg.norm(segments, axis=-1), expected, atol=0.01)
    length = np.linalg.norm(segments[:, 0] - segments[:, 1], axis=1).sum()
    assert length == pytest.approx(2 * np.pi * expected, rel=2e-3)


def test_plane_that_misses_gives_no_segments(ball):
    assert section(ball, tilted(RADIUS + 1)).shape == (0, 2, 2)


def test_grey_values_lie_where_the_contour_is(ball):
    plane = tilted(HEIGHT)
    image = sample_plane(
        lambda p: np.linalg.norm(p, axis=1), plane, np.array([-8.0, -8]), np.array([8.0, 8]), 0.5
    )
    s = -8 + 0.5 * (np.arange(32) + 0.5)
    expected = np.sqrt(s[None, :] ** 2 + s[:, None] ** 2 + HEIGHT**2)
    np.testing.assert_allclose(image, expected, atol=1e-9)


def test_drawn_slice_covers_contours_and_margin(ball):
    axes = Figure().subplots()
    drawn = draw_slice(
        axes,
        lambda p: p[:, 0],
        tilted(0),
        [Contours("ball", [ball], "lime"), Contours("none", [], "red")],
        margin=4,
    )
    assert list(drawn) == ["ball"]
    np.testing.assert_allclose([*axes.get_xlim(), *axes.get_ylim()], [-10, 10, -10, 10], atol=0.01)
    assert len(axes.images) == 1 and len(axes.collections) == 1


def test_sagittal_plane_of_a_bent_finger_holds_its_centroids():
    rotation = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    bent = np.array([[0.0, 0, 0], [40, 0, 0], [60, 0, -15], [60, 0, -35]]) @ rotation.T
    plane = sagittal_plane(bent, rotation @ [0.1, 1, 0], rotation @ [1, 0, 0])
    assert np.abs((bent - plane.origin) @ plane.normal).max() < 0.1


def test_sagittal_plane_of_a_straight_finger_keeps_the_given_side():
    straight = np.array([[0.0, 0.01, 0], [40, 0, 0.01], [60, -0.01, 0]])
    plane = sagittal_plane(straight, np.array([0.0, 1, 0]), np.array([1.0, 0, 0]))
    assert abs(plane.normal @ [0, 1, 0]) > 0.999 and plane.right @ [1, 0, 0] > 0.999


def test_transversal_plane_is_square_to_the_long_axis():
    bone = trimesh.creation.cylinder(radius=3, height=20, sections=32).vertices  # along z, -10..10
    plane = transversal_plane(np.asarray(bone), up=np.array([0.0, 1, 0]), place=0.25)
    assert abs(plane.normal[2]) == pytest.approx(1)
    assert abs(plane.origin[2]) == pytest.approx(5)
    np.testing.assert_allclose(plane.up, [0, 1, 0], atol=1e-9)
