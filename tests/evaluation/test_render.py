"""Pictures against what a sphere must look like."""

import numpy as np
import pytest
import trimesh

from handpipe.evaluation.rendering import Camera, Cut, Drawable, on_background, render
from handpipe.mesh.surfaces.surface import Surface

# looks down z: x is right, y is up
CAMERA = Camera(np.zeros(3), np.array([0.0, 0, -1]), np.array([0.0, 1, 0]), height=20.0)
SIZE = (120, 100)
PIXEL = 20.0 / 100  # mm


def sphere(radius: float, centre=(0.0, 0.0, 0.0)) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    return Surface(np.asarray(mesh.vertices) + centre, np.asarray(mesh.faces, dtype=np.int64))


def test_silhouette_has_the_area_of_the_disc():
    image = render([Drawable(sphere(7), (1, 0, 0))], CAMERA, SIZE)
    assert image.shape == (100, 120, 4) and image.dtype == np.uint8
    assert image[..., 3].sum() / 255 * PIXEL**2 == pytest.approx(np.pi * 49, rel=5e-3)


def test_place_in_the_picture_follows_the_cameras_axes():
    image = render([Drawable(sphere(2, (5, 3, 0)), (1, 1, 1))], CAMERA, SIZE)
    pixels = np.indices(image.shape[:2]).reshape(2, -1)
    row, column = np.average(pixels, axis=1, weights=image[..., 3].ravel())
    assert ((column + 0.5) - 60) * PIXEL == pytest.approx(5, abs=0.02)
    assert (50 - (row + 0.5)) * PIXEL == pytest.approx(3, abs=0.02)


def test_nearer_body_hides_the_farther_one():
    bodies = [Drawable(sphere(3, (0, 0, -5)), (0, 1, 0)), Drawable(sphere(2, (0, 0, 5)), (1, 0, 0))]
    middle = render(bodies, CAMERA, SIZE)[50, 60]
    assert middle[0] > 100 and middle[1] == 0


def test_transparent_skin_blends_with_what_is_inside():
    inside = Drawable(sphere(3), (0, 1, 0))
    alone = render([inside], CAMERA, SIZE)[50, 60].astype(float)
    skin = render([Drawable(sphere(8), (1, 0, 0), opacity=0.25)], CAMERA, SIZE)[50, 60].astype(float)
    both = render([Drawable(sphere(8), (1, 0, 0), opacity=0.25), inside], CAMERA, SIZE)[50, 60].astype(float)
    assert skin[3] == pytest.approx(0.25 * 255, abs=1)
    np.testing.assert_allclose(both[:3], 0.25 * skin[:3] + 0.75 * alone[:3], atol=2)


def test_cut_caps_a_closed_body_with_the_section_disc():
    # what is left is z < 4: the section's radius is sqrt(49 - 16)
    cut, fine = Cut(np.array([0.0, 0, 4]), np.array([0.0, 0, 1])), (480, 400)
    whole = on_background(render([Drawable(sphere(7), (1, 1, 1))], CAMERA, fine))
    opened = on_background(render([Drawable(sphere(7), (1, 1, 1))], CAMERA, fine, cut))
    y, x = (np.indices((400, 480)) + 0.5) * 20 / 400 - np.array([10, 12])[:, None, None]
    radius, section = np.hypot(x, y), np.sqrt(33)
    assert np.ptp(opened[radius < section - 0.1], axis=0).max() == 0
    assert np.ptp(whole[radius < section - 0.1], axis=0).max() > 20
    np.testing.assert_array_equal(opened[radius > section + 0.1], whole[radius > section + 0.1])


def test_fitted_camera_sees_everything():
    bodies = [Drawable(sphere(2, (30, 0, 4)), (1, 0, 0)), Drawable(sphere(4, (-9, 5, 1)), (0, 0, 1))]
    camera = Camera.fit(bodies, np.array([1.0, 1, -1]), np.array([0.0, 0, 1]), SIZE)
    alpha = render(bodies, camera, SIZE)[..., 3]
    assert alpha.any() and not (alpha[0].any() or alpha[-1].any() or alpha[:, 0].any() or alpha[:, -1].any())
    area = alpha.sum() / 255 * (camera.height / SIZE[1]) ** 2
    assert area == pytest.approx(np.pi * (4 + 16), rel=0.01)
