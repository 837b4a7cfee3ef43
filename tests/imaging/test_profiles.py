import numpy as np
import pytest
import trimesh
from phalanx import grid_points

from handpipe.imaging.bone_surfaces.marrow import contour
from handpipe.imaging.evidence.profiles import graph_laplacian, smooth_field, summed_curvature
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces.surface import Surface


@pytest.fixture
def ball():
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=5.0)
    return Surface(mesh.vertices, mesh.faces)


def test_curvature_of_a_ball_and_a_cylinder(ball) -> None:
    np.testing.assert_allclose(summed_curvature(ball), 2 / 5.0, rtol=0.02)
    grid = Volume(np.zeros((21, 21, 41), np.float32), np.diag([0.4, 0.4, 0.4, 1.0]))
    points = grid_points(grid) - 4.0
    cylinder = contour(grid.like(3.0 - np.hypot(points[..., 0], points[..., 1])), 0.0)
    middle = np.abs(cylinder.vertices[:, 2] - 8) < 5
    np.testing.assert_allclose(summed_curvature(cylinder)[middle], 1 / 3, atol=0.05)


def test_a_smooth_field_survives_outliers_and_gaps(ball) -> None:
    truth = 1 + 0.1 * ball.vertices[:, 2] / 5
    random = np.random.default_rng(0)
    measured = truth + 0.05 * random.standard_normal(len(truth))
    wrong = random.random(len(truth)) < 0.15
    measured[wrong] += 1.5
    confidence = np.where(ball.vertices[:, 0] > 4, 0.0, 1.0)  # a cap without measurements
    laplacian = graph_laplacian(ball.triangles, len(truth))
    field, weights = smooth_field(laplacian, measured, confidence, 2.0, 0.3)
    assert np.abs(field - truth).max() < 0.1
    assert weights[wrong].max() < 0.1
