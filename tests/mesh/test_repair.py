import numpy as np
import pytest

from handpipe.mesh.contact.self_cuts import cuts_itself
from handpipe.mesh.generation.surface_repair import repair
from handpipe.mesh.surfaces.hull import convex_hull
from handpipe.mesh.surfaces.surface import Surface, concatenate

from .shapes import smallest_angles, sphere


def test_a_good_surface_stays_as_it_is():
    surface, said = repair(sphere(10, 3))
    assert said == []
    np.testing.assert_array_equal(surface.vertices, sphere(10, 3).vertices)


def test_holes_of_a_sphere_are_filled_along_the_sphere():
    whole = sphere(10, 4)
    height = whole.vertices[whole.triangles].mean(axis=1)
    opened = Surface(whole.vertices, whole.triangles[(height[:, 2] < 8) & (height[:, 0] > -9.3)]).compact()
    surface, said = repair(opened)
    assert surface.is_closed()
    assert "2 holes" in said[0]
    assert surface.volume() == pytest.approx(whole.volume(), rel=5e-3)
    assert np.abs(np.linalg.norm(surface.vertices, axis=1) - 10).max() < 0.2
    np.testing.assert_array_equal(surface.vertices[: len(opened.vertices)], opened.vertices)
    assert smallest_angles(surface).min() > 20


def test_a_soup_of_turned_triangles_with_crumbs_becomes_a_sphere():
    whole, crumb = sphere(10, 3), sphere(0.2, 1)
    triangles = whole.triangles.copy()
    triangles[::7] = triangles[::7, ::-1]
    soup = Surface(whole.vertices[triangles].reshape(-1, 3), np.arange(3 * len(triangles)))
    flat = Surface(soup.vertices[:3], np.array([[0, 1, 1]]))
    surface, said = repair(concatenate([soup, flat, crumb.moved(crumb.vertices + 30)]))
    assert surface.is_closed()
    assert surface.volume() == pytest.approx(whole.volume())
    words = " ".join(said)
    assert all(word in words for word in ("duplicate", "no area", "loose", "face outwards"))


def test_inside_out_is_turned():
    surface, said = repair(sphere(10, 2).flipped())
    assert surface.volume() == pytest.approx(sphere(10, 2).volume())
    assert said == ["Turned 320 triangles to face outwards."]


def test_overlapping_spheres_become_their_union():
    ball = sphere(5, 4)
    pair = concatenate([ball, ball.moved(ball.vertices + [6, 0, 0])])
    assert cuts_itself(pair)
    surface, said = repair(pair)
    lens = np.pi * (4 * 5 + 6) * (2 * 5 - 6) ** 2 / 12
    assert "cut itself" in said[-1]
    assert surface.is_closed()
    assert not cuts_itself(surface)
    assert surface.volume() == pytest.approx(2 * 500 / 3 * np.pi - lens, rel=0.02)


def test_convex_hull_of_a_sphere_with_points_inside():
    inside = np.random.default_rng(0).uniform(-2, 2, (50, 3))
    hull = convex_hull(np.concatenate([inside, sphere(5, 3).vertices]))
    assert hull.is_closed()
    assert len(hull.vertices) == len(sphere(5, 3).vertices)
    assert hull.volume() == pytest.approx(sphere(5, 3).volume(), rel=1e-3)
