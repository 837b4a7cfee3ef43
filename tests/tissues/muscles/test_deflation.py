"""Inscribed balls against known bodies; bodies drawn in stay inside themselves and become threads."""

import numpy as np
import pytest
import trimesh
from tests.tissues.muscles.crossings import inside

from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.muscles.separation.deflation import STEP_SHARE, Deflation, inscribed_radii


def ellipsoid(radii, subdivisions: int = 3) -> Surface:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Surface(sphere.vertices * radii, sphere.faces)


def test_inscribed_balls_of_an_ellipsoid():
    """At the end of the shortest half axis, itself; at the end of the longest a, the curvature's c^2 / a."""
    surface = ellipsoid([10, 4, 3], 4)
    radii = inscribed_radii(surface)
    flat, tip = surface.vertices[:, 2].argmax(), surface.vertices[:, 0].argmax()
    assert radii[flat] == pytest.approx(3, rel=0.02)
    assert radii[tip] == pytest.approx(9 / 10, rel=0.25)  # a mesh of edges of half that length


def test_shrinks_inside_itself_down_to_a_thread():
    surface = ellipsoid([10, 4, 1.5])
    deflation, everywhere = Deflation(surface), np.arange(len(surface.vertices))
    assert np.array_equal(deflation.vertices(), surface.vertices)
    sizes = [surface.volume()]
    for step in range(14):
        deflation.step(everywhere)
        sizes.append(surface.moved(deflation.vertices()).volume())
        assert step > 5 or inside(deflation.vertices(), surface).all()
    assert (np.diff(sizes) < 0).all() and sizes[-1] < 0.01 * sizes[0]


def test_draws_in_where_it_was_met_alone():
    surface = ellipsoid([20, 3, 2])
    deflation = Deflation(surface)
    end = np.flatnonzero(surface.vertices[:, 0] > 15)
    for _ in range(3):
        deflation.step(end)
    moved = np.linalg.norm(deflation.vertices() - surface.vertices, axis=1)
    far = surface.vertices[:, 0] < 0
    way = 3 * STEP_SHARE * inscribed_radii(surface)[end].mean()
    assert 0.3 * way < moved[end].mean() < way  # directions round a thin end cancel in part
    assert moved[far].max() < 0.01 * moved[end].mean()
