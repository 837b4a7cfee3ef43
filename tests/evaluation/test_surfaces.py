"""Distances against analytic spheres."""

import numpy as np
import pytest
import trimesh

from handpipe.evaluation import surfaces
from handpipe.mesh.surfaces.surface import Surface


def sphere(radius: float, centre=(0.0, 0.0, 0.0), subdivisions: int = 4) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Surface(np.asarray(mesh.vertices) + centre, np.asarray(mesh.faces, dtype=np.int64))


FACET = 0.01  # mm: sagitta of the icosphere's facets, radius 5


def test_distance_of_points_to_sphere():
    points = np.random.default_rng(0).normal(size=(500, 3)) * 6
    expected = np.abs(np.linalg.norm(points, axis=1) - 5)
    np.testing.assert_allclose(surfaces.surface_distance(points, sphere(5)), expected, atol=FACET)


def test_symmetric_distance_counts_both_directions():
    small, large = sphere(4), sphere(5)
    distances = surfaces.symmetric_distance(small, large)
    assert len(distances) == len(small.vertices) + len(large.vertices)
    np.testing.assert_allclose(distances, 1.0, atol=FACET)


@pytest.mark.parametrize("gap", [-1.5, 0.5])
def test_penetration_of_two_spheres(gap):
    a, b = sphere(5), sphere(5, centre=(10 + gap, 0, 0))
    assert surfaces.penetration(a.vertices, b).max() == pytest.approx(max(-gap, 0.0), abs=FACET)


def test_penetration_is_depth_below_the_surface():
    points = np.array([[0, 0, 4.0], [3, 0, 0], [0, 7, 0]])
    np.testing.assert_allclose(surfaces.penetration(points, sphere(5)), [1, 2, 0], atol=FACET)


def test_curve_distance_of_parallel_lines():
    a = np.column_stack([np.linspace(0, 10, 7), np.zeros(7), np.zeros(7)])
    b = np.column_stack([np.linspace(0, 10, 23), np.full(23, 0.3), np.full(23, 0.4)])
    np.testing.assert_allclose(surfaces.curve_to_curve_distance(a, b), 0.5, atol=1e-12)


def test_curve_distance_beyond_the_end_is_to_the_end():
    line = np.array([[0.0, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(surfaces.curve_distance(np.array([[4.0, 4, 0]]), line), 5.0)


def test_dice_of_shifted_boxes():
    a, b = np.zeros((12, 10, 10), np.uint8), np.zeros((12, 10, 10), np.uint8)
    a[0:8], b[2:10] = 3, 3
    assert surfaces.dice(a, b, 3) == pytest.approx(6 / 8)
    assert surfaces.dice(a, b, 9) == 1.0
    assert surfaces.dice(a, b, 0) == pytest.approx(2 / 4)
