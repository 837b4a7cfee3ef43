import numpy as np
import pytest
from pytest import LogCaptureFixture
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from tests.imaging.phalanx import Phalanx, grid_points

from handpipe.imaging.bone_surfaces.marrow import contour
from handpipe.imaging.evidence.tubes import tangents_of
from handpipe.imaging.volumes import Volume
from handpipe.mesh.surfaces.distance import Distance
from handpipe.tissues.tendons.fitting.extraction import centre_finder, extract
from handpipe.tissues.tendons.fitting.rough_path import extract_roughly


def test_a_curve_within_a_bone_finds_the_tendon_beside_it() -> None:
    phalanx = Phalanx()
    volume = phalanx.volume()
    bone = contour(volume.like(-phalanx.bone(grid_points(volume))), 0.0)
    z = -(phalanx.marrow_radius + 1.1 + phalanx.tendon_radius - 0.1)
    curve = np.stack(
        [np.linspace(-6, 6, 20), np.full(20, 0.3), np.full(20, 0.4 - phalanx.marrow_radius)], axis=1
    )
    assert Distance(bone).signed(curve)[0].max() < -0.5
    find = centre_finder(volume, phalanx.tendon_radius, Distance(bone))
    for _ in range(3):
        curve, confidence = find(curve, tangents_of(curve))
    assert confidence.min() > 0.2
    assert np.hypot(curve[:, 1], curve[:, 2] - z).max() < 0.15


def tube_image(line: np.ndarray, end: float) -> Volume:
    """A dark tube of 1.8 mm about a line (n, 3) up to x = end, in a bright slab in dark air."""
    shape = (110, 40, 44)
    affine = np.diag([0.8, 0.8, 0.8, 1.0])
    affine[:3, 3] = [-4.0, -16.0, -20.0]
    points = np.moveaxis(np.indices(shape), 0, -1) @ affine[:3, :3] + affine[:3, 3]
    values = np.where(np.abs(points[..., 2]) < 13.0, 100.0, 3.0)
    apart = cKDTree(line[line[:, 0] <= end]).query(points)[0]
    values = np.where(apart < 1.8, 8.0, values)
    noise = np.random.default_rng(0).normal(0.0, 2.0, shape)
    return Volume((gaussian_filter(values, 0.5) + noise).astype(np.float32), affine)


def bent_line() -> np.ndarray:
    x = np.linspace(0.0, 80.0, 400)
    return np.column_stack([x, 1.0 + 0.0 * x, -6.0 + 2.0 * np.sin(x / 20.0)])


@pytest.mark.parametrize("end", [80.0, 45.0])
def test_a_path_that_leaves_the_tendon_is_brought_back_onto_it(end: float, caplog: LogCaptureFixture) -> None:
    """The path is in the tendon for 20 mm, then leads up to 7 mm off, into the air, and ends at x = 70."""
    line = bent_line()
    path = line[::50] - np.array([0.0, 0.0, 1.0]) * np.clip((line[::50, :1] - 20.0) / 5.0, 0.0, 7.0)
    volume = tube_image(line, end)
    rod = extract_roughly(volume, path, 1.8).x
    reached = rod[:, 0] < end - 3.0
    assert cKDTree(line).query(rod[reached])[0].max() < 0.5
    assert rod[-1, 0] == pytest.approx(min(end, 70.0), abs=6.0)
    assert ("left out" in caplog.text) == (end < 80.0)
    astray = extract(volume, path, 1.8).x
    assert cKDTree(line).query(astray[astray[:, 0] < end - 3.0])[0].max() > 2.0  # so that the test can fail


def test_a_path_along_the_tendon_is_taken_as_it_is() -> None:
    path = bent_line()[::50] + [0.0, 0.5, -0.4]
    volume = tube_image(bent_line(), 80.0)
    np.testing.assert_array_equal(extract_roughly(volume, path, 1.8).x, extract(volume, path, 1.8).x)
