"""Remeshing with a fine region against lengths, volumes and distances of a sphere."""

import numpy as np
import pytest
import trimesh

from handpipe.mesh.generation.graded_remeshing import remesh_graded
from handpipe.mesh.surfaces.surface import Surface

RADIUS, FINE, COARSE = 10.0, 0.6, 2.4


@pytest.fixture(scope="module")
def ball() -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=RADIUS)
    return Surface(np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.fixture(scope="module")
def graded(ball: Surface) -> Surface:
    return remesh_graded(ball, ball.vertices[:, 2] > 8.0, FINE, COARSE)


def lengths_and_heights(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    ends = surface.vertices[surface.edges()]
    return np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), ends[:, :, 2].mean(axis=1)


def test_edges_are_short_in_the_region_and_long_far_from_it(graded: Surface) -> None:
    lengths, z = lengths_and_heights(graded)
    assert abs(np.median(lengths[z > 8.2]) / FINE - 1) < 0.15
    assert abs(np.median(lengths[z < 0.0]) / COARSE - 1) < 0.15
    between = np.median(lengths[(z > 5.5) & (z < 7.0)])
    assert FINE < between < COARSE


def test_it_is_the_same_closed_sphere_of_good_triangles(graded: Surface) -> None:
    assert graded.is_closed
    np.testing.assert_allclose(np.linalg.norm(graded.vertices, axis=1), RADIUS, atol=0.05)
    assert abs(graded.volume() / (4 / 3 * np.pi * RADIUS**3) - 1) < 0.03
    corners = graded.vertices[graded.triangles]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert (sides.max(axis=1) / sides.min(axis=1)).max() < 4.0  # one step from coarse to fine has slivers


def test_without_a_region_all_is_coarse(ball: Surface) -> None:
    plain = remesh_graded(ball, np.zeros(len(ball.vertices), dtype=bool), FINE, COARSE)
    assert abs(np.median(lengths_and_heights(plain)[0]) / COARSE - 1) < 0.15
