import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.mesh.surfaces import Surface
from handpipe.mesh.surfaces.smoothing import delta_mush, laplacian, taubin

from .shapes import sphere


@pytest.mark.parametrize("smooth", [laplacian, taubin])
def test_noise_goes_and_the_volume_stays(smooth):
    shape = sphere(10, 4)
    noise = np.random.default_rng(0).normal(0, 0.1, len(shape.vertices))
    rough = shape.moved(shape.vertices * (1 + noise / 10)[:, None])
    result = smooth(rough, 10)
    assert np.linalg.norm(result.vertices, axis=1).std() < 0.4 * np.linalg.norm(rough.vertices, axis=1).std()
    assert result.volume() == pytest.approx(rough.volume(), rel=1e-3)


def test_taubin_keeps_a_low_wave_that_laplacian_smoothing_flattens():
    shape = sphere(10, 4)
    wave = shape.vertices[:, 2] ** 2 / 100 - 1 / 3
    bumpy = shape.moved(shape.vertices * (1 + 0.1 * wave)[:, None])

    def amplitude(surface):
        return np.polyfit(wave, np.linalg.norm(surface.vertices, axis=1), 1)[0]

    before = amplitude(bumpy)
    assert abs(amplitude(taubin(bumpy, 60)) - before) < 0.5 * abs(amplitude(laplacian(bumpy, 120)) - before)


def bumpy_plate():
    """A plate of 40 x 30 mm with bumps of 1 mm."""
    x, y = np.meshgrid(np.linspace(-20, 20, 41), np.linspace(-15, 15, 31), indexing="ij")
    bumps = np.cos(2 * np.pi * x / 8) * np.cos(2 * np.pi * y / 8)
    ids = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]))
    flat = np.stack([x, y, bumps], axis=2).reshape(-1, 3)
    return Surface(flat, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def rolled(points, radius):
    """A plate on a cylinder: heights stay normal to it."""
    angle, r = points[:, 0] / radius, radius + points[:, 2]
    return np.stack([r * np.sin(angle), points[:, 1], r * np.cos(angle)], axis=1)


def test_delta_mush_changes_no_rigid_motion():
    plate = bumpy_plate()
    turned = Rotation.from_rotvec([0.4, -1.1, 0.7]).apply(plate.vertices) + [3, 1, 2]
    np.testing.assert_allclose(delta_mush(plate, turned, 8), turned, atol=1e-9)


def test_delta_mush_takes_wrinkles_of_the_deformation_and_keeps_bumps_of_the_rest_shape():
    plate = bumpy_plate()
    right = rolled(plate.vertices, 60.0)
    wrinkled = plate.vertices.copy()
    wrinkled[:, 2] += 0.3 * (-1.0) ** np.round(plate.vertices[:, 0])
    found = delta_mush(plate, rolled(wrinkled, 60.0), 8)
    inner = (np.abs(plate.vertices[:, :2]) < [14, 9]).all(axis=1)  # smoothing draws the rim inwards
    error = np.linalg.norm(found - right, axis=1)[inner]
    assert error.mean() < 0.06  # of wrinkles of 0.3 mm
    heights = np.hypot(found[inner, 0], found[inner, 2]) - 60.0
    assert np.polyfit(plate.vertices[inner, 2], heights, 1)[0] == pytest.approx(1.0, abs=0.03)
