"""Crossings of triangles, against bodies that are known to meet or not."""

import numpy as np
import trimesh

from handpipe.mesh.contact.crossing_triangles import crossings
from handpipe.mesh.surfaces.surface import Surface, concatenate


def ball(centre: tuple[float, float, float]) -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    return Surface(np.array(mesh.vertices) + centre, np.array(mesh.faces))


def test_balls_that_meet_and_balls_that_do_not() -> None:
    apart = concatenate([ball((0, 0, 0)), ball((2.1, 0.01, 0.02)), ball((0, 2.2, 0.03))])
    assert len(crossings(apart)) == 0
    meeting = concatenate([ball((0, 0, 0)), ball((1.5, 0.01, 0.02))])
    found = crossings(meeting)
    middles = meeting.vertices[meeting.edges()[found[:, 0]]].mean(axis=1)
    # They meet in a circle around the middle between them, of radius sqrt(1 - 0.75^2).
    assert len(found) > 20
    np.testing.assert_allclose(middles[:, 0], 0.75, atol=0.12)
    np.testing.assert_allclose(np.hypot(*middles[:, 1:].T), 0.66, atol=0.12)


def test_one_edge_through_one_triangle() -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.2, 0.2, -1], [0.3, 0.2, 1], [5, 5, 0.5]]
    surface = Surface(np.array(corners, dtype=float), np.array([[0, 1, 2], [3, 4, 5]]))
    pairs = crossings(surface)
    assert [tuple(surface.edges()[e]) for e, t in pairs if t == 0] == [(3, 4)]
