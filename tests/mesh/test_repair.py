import numpy as np
import pytest

from handpipe.mesh.contact.self_cuts import cuts_itself
from handpipe.mesh.generation.hole_filling import fill_holes
from handpipe.mesh.generation.surface_repair import repair
from handpipe.mesh.surfaces.distance import Distance
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


def test_a_patch_asks_for_nothing_but_what_is_near():
    whole = sphere(10, 4)
    height = whole.vertices[whole.triangles].mean(axis=1)[:, 2]
    bowl, ring = (
        fill_holes(Surface(whole.vertices, whole.triangles[kept]).compact(), [])
        for kept in (height < 8, (height < 8) & (height > 3))
    )
    cap = bowl.vertices[bowl.vertices[:, 2] > 8.2]
    assert len(cap) > 50
    assert Distance(ring).closest(cap)[0].max() < 0.02


def test_a_vertex_between_two_fans_stays_one_vertex():
    whole = sphere(10, 3)
    lower = whole.moved(whole.vertices - [0, 0, 2 * whole.vertices[:, 2].max()])
    pole, other = whole.vertices[:, 2].argmin(), lower.vertices[:, 2].argmax()
    triangles = lower.triangles + len(whole.vertices)
    triangles[lower.triangles == other] = pole
    pair = Surface(np.vstack([whole.vertices, lower.vertices]), np.vstack([whole.triangles, triangles]))
    top = (pair.triangles == whole.vertices[:, 2].argmax()).any(axis=1)
    opened = Surface(pair.vertices, pair.triangles[~top]).compact()
    filled = fill_holes(opened, [])
    assert filled.is_closed()
    np.testing.assert_array_equal(filled.vertices[: len(opened.vertices)], opened.vertices)
    assert filled.volume() == pytest.approx(2 * whole.volume(), rel=2e-3)
    kept = {tuple(np.roll(t, -t.argmin())) for t in filled.triangles}
    assert {tuple(np.roll(t, -t.argmin())) for t in opened.triangles} <= kept


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


def test_a_place_that_cuts_itself_is_filled_and_all_else_stays():
    ball = sphere(10, 4)
    order = np.argsort(-ball.vertices[:, 2])
    swapped = ball.vertices.copy()
    swapped[order[[0, 8]]] = ball.vertices[order[[8, 0]]]  # two vertices that are not neighbours
    assert cuts_itself(Surface(swapped, ball.triangles))
    surface, said = repair(Surface(swapped, ball.triangles))
    assert "cut itself" in said[-1]
    assert surface.is_closed()
    assert not cuts_itself(surface)
    assert np.abs(np.linalg.norm(surface.vertices, axis=1) - 10).max() < 0.1
    away = ball.vertices[ball.vertices[:, 2] < 8]
    assert (np.linalg.norm(surface.vertices[:, None] - away, axis=2).min(axis=0) == 0).all()


def test_a_fin_on_three_triangles_is_cut_off():
    ball = sphere(10, 3)
    edge = ball.edges()[40]
    fin = np.append(edge, len(ball.vertices))
    tip = 1.02 * ball.vertices[edge].mean(axis=0)
    surface, _ = repair(Surface(np.vstack([ball.vertices, tip]), np.vstack([ball.triangles, fin])))
    assert surface.is_closed()
    assert not cuts_itself(surface)
    assert surface.volume() == pytest.approx(ball.volume(), rel=1e-3)
    kept = (np.linalg.norm(surface.vertices[:, None] - ball.vertices, axis=2).min(axis=0) == 0).mean()
    assert kept > 0.95


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
