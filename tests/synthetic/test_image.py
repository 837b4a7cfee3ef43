"""The image model against closed forms."""

import numpy as np
import pytest
import trimesh
from scipy.ndimage import binary_erosion

from handpipe.synthetic.acquisition import image


@pytest.fixture
def ball() -> tuple[np.ndarray, np.ndarray]:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=5.0)
    return np.asarray(mesh.vertices) + [1.0, 2.0, 3.0], np.asarray(mesh.faces, dtype=np.int64)


def test_signed_distance_of_a_ball(ball):
    grid = image.VoxelGrid.around(ball[0], 3.0, 0.7)
    distance = image.signed_distance(ball, grid, 1.5)
    points = grid.origin + grid.spacing * np.indices(grid.shape).reshape(3, -1).T
    exact = np.clip(np.linalg.norm(points - [1.0, 2.0, 3.0], axis=1) - 5.0, -1.5, 1.5)
    np.testing.assert_allclose(distance.ravel(), exact, atol=0.015)


def test_surface_that_leaves_the_grid(ball):
    grid = image.VoxelGrid((9, 9, 9), np.array([0.0, 1.0, 2.0]), 0.5)
    distance = image.signed_distance(ball, grid, 1.0)
    points = grid.origin + grid.spacing * np.indices(grid.shape).reshape(3, -1).T
    exact = np.clip(np.linalg.norm(points - [1.0, 2.0, 3.0], axis=1) - 5.0, -1.0, 1.0)
    np.testing.assert_allclose(distance.ravel(), exact, atol=0.015)


@pytest.mark.parametrize("spacing", [0.5, 0.8])
def test_occupancy_adds_up_to_the_volume(ball, spacing):
    grid = image.VoxelGrid.around(ball[0], 2.0, spacing)
    total = image.occupancy(ball, grid).sum() * spacing**3
    assert total == pytest.approx(trimesh.Trimesh(*ball).volume, rel=0.01)


def test_surfaces_of_one_tissue_that_touch_show_no_seam():
    left = trimesh.creation.box(bounds=[[0, 0, 0], [5.13, 10, 10]])
    right = trimesh.creation.box(bounds=[[5.13, 0, 0], [10, 10, 10]])
    surfaces = [(np.asarray(m.vertices), np.asarray(m.faces, dtype=np.int64)) for m in (left, right)]
    grid = image.VoxelGrid.around(np.vstack([s[0] for s in surfaces]), 2.0, 0.8)
    painted = np.full(grid.shape, 0.9)
    image.paint_shares(painted, 0.45, (s for one in surfaces for s in image.local_occupancy(one, grid)))
    centre = painted[4:-4, 6:-6, 6:-6]
    np.testing.assert_allclose(centre, 0.45, atol=1e-12)
    assert painted.max() == 0.9


def test_later_tissues_cover_earlier_ones(ball):
    small = (ball[0].mean(axis=0) + 0.5 * (ball[0] - ball[0].mean(axis=0)), ball[1])
    grid = image.VoxelGrid.around(ball[0], 2.0, 0.8)
    layers = [("outer", image.occupancy(ball, grid)), ("inner", image.occupancy(small, grid))]
    painted = image.paint_layers(layers, {"air": 0.0, "outer": 0.1, "inner": 1.0}, grid)
    core = binary_erosion(image.occupancy(small, grid) == 1.0)
    assert np.all(painted[core] == 1.0)
    shell = (image.occupancy(ball, grid) == 1.0) & (image.occupancy(small, grid) == 0.0)
    assert shell.any()
    np.testing.assert_allclose(painted[shell], 0.1)


def test_rician_noise_and_bias():
    grid = image.VoxelGrid((40, 40, 40), np.zeros(3), 1.0)
    rng = np.random.default_rng(0)
    scanned, bias, gain = image.acquire(np.zeros(grid.shape), grid, rng, noise=0.03)
    # Where there is no signal, Rician noise is Rayleigh: mean sigma sqrt(pi / 2).
    assert scanned.mean() / gain == pytest.approx(0.03 * np.sqrt(np.pi / 2), rel=0.01)
    assert 0.8 <= bias.min() < bias.max() <= 1.2
    assert max(bias.max() - 1.0, 1.0 - bias.min()) == pytest.approx(0.2)
    bright, bias, gain = image.acquire(np.ones(grid.shape), grid, rng, noise=0.03)
    residual = bright / gain - bias
    assert residual.std() == pytest.approx(0.03, rel=0.02)
    assert abs(residual.mean()) < 0.001
