"""Coarser copies of surfaces, against a sphere of known shape."""

import numpy as np
import pytest

from handpipe.mesh.generation.simplification import simplified
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

from .shapes import sphere


@pytest.mark.parametrize("opened", [False, True])
def test_a_coarser_sphere_stays_on_the_sphere(opened):
    ball = sphere(10, 5)
    if opened:
        ball = Surface(ball.vertices, ball.triangles[ball.vertices[ball.triangles][:, :, 2].max(axis=1) < 7])
    coarse = simplified(ball.compact(), 1.0)
    assert np.median(coarse.edge_lengths()) == pytest.approx(1.0, rel=0.2)
    assert np.abs(Distance(coarse).closest(ball.compact().vertices)[0]).max() < 0.05
    assert coarse.is_closed() != opened


def test_a_surface_that_is_coarse_stays_as_it_is():
    ball = sphere(10, 2)
    assert simplified(ball, 1.0) is ball


def test_a_fin_is_no_obstacle():
    ball = sphere(10, 5)
    edge = ball.edges()[40]
    vertices = np.vstack([ball.vertices, 1.02 * ball.vertices[edge].mean(axis=0)])
    coarse = simplified(Surface(vertices, np.vstack([ball.triangles, [*edge, len(ball.vertices)]])), 1.0)
    assert coarse.is_closed()
    assert np.abs(np.linalg.norm(coarse.vertices, axis=1) - 10).max() < 0.1
