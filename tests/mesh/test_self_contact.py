"""Contact of a surface with itself, on a fork whose prongs are round: distances are known."""

from functools import cache

import numpy as np
import pytest

from handpipe.mesh.contact.self_contacts import self_contact

from .shapes import fork

RADIUS, APART = 3.0, 5.0  # of the prongs; of their axes from the middle


@cache
def at_rest():
    return fork(RADIUS, APART, edge=1.0)


def closed(shift):
    """The fork at rest, and with both prongs moved to the middle; how far their axes are from it."""
    rest = at_rest()
    x, y, _ = rest.vertices.T
    moved = rest.vertices.copy()
    moved[:, 1] -= np.sign(y) * shift * np.clip((x - 4) / 4, 0, 1)
    return rest, rest.moved(moved), APART - shift


@pytest.mark.parametrize("shift", [1.7, 2.5])
def test_gaps_are_those_of_two_cylinders(shift):
    rest, surface, apart = closed(shift)
    found = self_contact(surface, rest, near=1.0, deep=6.0)
    points = surface.vertices[found.vertices]
    shaft = (points[:, 0] > 9) & (points[:, 0] < 18)
    other = -np.sign(rest.vertices[found.vertices, 1]) * apart
    true = np.hypot(points[:, 1] - other, points[:, 2]) - RADIUS
    assert shaft.sum() > 20
    np.testing.assert_allclose(found.gaps[shaft], true[shaft], atol=0.12)


@pytest.mark.parametrize("shift", [2.5, 3.5])
def test_every_vertex_beneath_the_other_prong_is_found(shift):
    rest, surface, apart = closed(shift)
    found = self_contact(surface, rest, near=1.0, deep=6.0)
    x, y, z = surface.vertices.T
    other = -np.sign(rest.vertices[:, 1]) * apart
    beneath = (x > 9) & (x < 18) & (np.hypot(y - other, z) < RADIUS - 0.1)
    assert beneath.any()
    assert np.isin(np.flatnonzero(beneath), found.vertices).all()
    deep = found.gaps < -0.1
    assert np.all(surface.vertices[found.vertices[deep], 0] > 4)  # not across the base


def test_feet_make_up_places_on_the_other_prong():
    rest, surface, apart = closed(2.5)
    found = self_contact(surface, rest, near=1.0, deep=6.0)
    places = found.feet @ surface.vertices
    offsets = surface.vertices[found.vertices] - places
    np.testing.assert_allclose(np.einsum("ni,ni->n", offsets, found.normals), found.gaps, atol=1e-12)
    sides = np.sign(found.feet @ np.sign(rest.vertices[:, 1]))
    np.testing.assert_array_equal(sides, -np.sign(rest.vertices[found.vertices, 1]))


def test_a_surface_at_rest_does_not_touch_itself():
    rest = at_rest()
    found = self_contact(rest, rest, near=1.0, deep=6.0)
    assert len(found.vertices) == 0
