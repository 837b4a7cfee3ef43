"""Rods in equilibrium against shapes known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from handpipe.core.arrays import Array
from handpipe.core.errors import ConvergenceError
from handpipe.tissues.tendons.rods.energies import Bend, EndForce, Hooks, closest_on_spline, spline_shape
from handpipe.tissues.tendons.rods.equilibrium import RodOptions, solve
from handpipe.tissues.tendons.rods.rod import (
    bishop_normals,
    closest_on_rod,
    directions,
    lay,
    length_change,
    perpendicular,
    segment_length,
    unit,
)


def straight(count: int, length: float = 1.0) -> Array:
    return np.stack([np.arange(count + 1) * length, np.zeros(count + 1), np.zeros(count + 1)], axis=1)


def crumpled(count: int, seed: int, size: float = 0.4) -> Array:
    random = np.random.default_rng(seed)
    d = unit([1.0, 0, 0] + size * random.standard_normal((count, 3)))
    return np.vstack([np.zeros(3), np.cumsum(d, axis=0)])


@pytest.mark.parametrize("seed", range(3))
def test_pulled_rod_is_straight_along_the_force(seed: int) -> None:
    force = np.array([0.3, 0.4, 0.0])
    found = solve([EndForce(force), Bend(0.5, 1.0)], crumpled(60, seed))
    np.testing.assert_allclose(directions(found.x), np.tile([0.6, 0.8, 0], (60, 1)), atol=1e-6)
    np.testing.assert_allclose(found.tension, 0.5, rtol=1e-6)
    assert length_change(found.x, 1.0) < 1e-12


@pytest.mark.parametrize("length", [1.0, 0.25])
def test_hooks_hold_an_analytic_polyline(length: float) -> None:
    """A taut string without bending: straight spans whose corners give way by force / (2 weight).

    The discrete rod cuts a corner by a part of a segment.
    """
    weight, tension = 50.0, 0.5
    corners = np.array([[0.0, 0, 0], [20.0, 6.0, 0], [45.0, -2.0, 5.0]])
    ahead = unit(np.array([1.0, 0.2, 0.1]))
    start = lay(corners, length, int(80 / length), ahead)
    found = solve([Hooks(corners[1:], weight), EndForce(tension * ahead), Bend(1e-4, length)], start)
    spans = unit(np.array([corners[1] - corners[0], corners[2] - corners[1], ahead]))
    give = tension * (spans[1:] - spans[:-1]) / (2 * weight)
    string = np.vstack([corners[0], corners[1:] + give, corners[2] + give[1] + 60 * ahead])
    assert closest_on_rod(found.x, string)[2].max() < 0.2 * length
    np.testing.assert_allclose(found.tension, tension, rtol=0.06)
    assert length_change(found.x, length) < 1e-12


def pulley_hooks(angle: float, radius: float) -> tuple[Array, Array]:
    """Hooks round a quarter-like turn by `angle` about the origin after a straight run, and the way out."""
    turn = np.linspace(0, angle, max(int(np.ceil(angle * radius / 1.5)), 1) + 1)
    arc = radius * np.stack([np.sin(turn), np.cos(turn), 0 * turn], axis=1)
    run = np.stack([np.arange(-20.0, 0, 4.0), np.full(5, radius), np.zeros(5)], axis=1)
    out = np.array([np.cos(angle), -np.sin(angle), 0.0])
    after = arc[-1] + np.arange(4.0, 20.0, 4.0)[:, None] * out
    return np.vstack([run, arc, after]), out


def test_excursion_over_a_pulley_is_radius_times_angle() -> None:
    """The free end's way beyond the joint shortens by the arc's length: hooks let the rod slide."""
    radius, angle, length, count = 8.0, np.pi / 2, 1.2, 100
    ends = []
    for turned in (0.0, angle):
        hooks, out = pulley_hooks(turned, radius)
        first = np.array([[-22.0, radius, 0.0]])
        start = lay(np.vstack([first, hooks]), length, count, out)
        found = solve([Hooks(hooks), EndForce(0.05 * out), Bend(0.05, length)], start)
        exit_point = radius * np.array([np.sin(turned), np.cos(turned), 0.0])
        ends.append((found.x[-1] - exit_point) @ out)
    assert ends[0] - ends[1] == pytest.approx(radius * angle, abs=0.1)


def test_different_starts_reach_the_same_rod() -> None:
    hooks, out = pulley_hooks(1.2, 8.0)
    first = np.array([[-22.0, 8.0, 0.0]])
    along = lay(np.vstack([first, hooks]), 1.2, 80, out)
    shaken = unit(directions(along) + 0.1 * np.random.default_rng(0).standard_normal((80, 3)))
    other = np.vstack([first, first + 1.2 * np.cumsum(shaken, axis=0)])
    results = [solve([Hooks(hooks), EndForce(0.5 * out), Bend(1.0, 1.2)], x).x for x in (along, other)]
    np.testing.assert_allclose(results[0], results[1], atol=1e-5)


def test_first_vertex_and_lengths_are_kept() -> None:
    x = crumpled(50, 4, 0.2)
    hooks = x[5:45:5] + [0.0, 1.0, 0.0]
    found = solve([Hooks(hooks), EndForce(np.array([0.5, 0, 0])), Bend(1.0, 1.0)], x)
    np.testing.assert_array_equal(found.x[0], x[0])
    assert length_change(found.x, segment_length(x)) < 1e-12


@pytest.mark.parametrize("short", [0.7, 0.9, 1.1])
def test_a_hook_at_the_end_does_not_let_go_and_hold_for_ever(short: float) -> None:
    """Held, the bent rod ends before the hook, which lets go; let go, the straight one reaches beside it."""
    hook = Hooks(np.array([[20.0 - short, 6.0, 0.0]]), 5.0)
    found = solve([hook, EndForce(np.array([0.5, 0, 0])), Bend(0.5, 1.0)], straight(20))
    np.testing.assert_allclose(found.x, straight(20), atol=1e-6)
    np.testing.assert_allclose(found.tension, 0.5, rtol=1e-6)


def test_a_compressed_rod_reaches_the_folded_minimum_and_not_the_saddle() -> None:
    """Against its pull a straight rod balances, but any bend of it is a way down: it turns round."""
    start = straight(20)
    start[5:, 1] += 1e-3 * np.arange(16)
    start = lay(start, 1.0, 20, np.array([1.0, 0, 0]))
    found = solve([EndForce(np.array([-0.5, 0, 0])), Bend(0.5, 1.0)], start)
    np.testing.assert_allclose(directions(found.x), np.tile([-1.0, 0, 0], (20, 1)), atol=1e-6)


def test_closest_point_is_the_closest_of_a_densely_sampled_curve() -> None:
    random = np.random.default_rng(0)
    x = crumpled(60, 0, 3.0)
    points = random.uniform(x.min(axis=0), x.max(axis=0), (200, 3))
    piece, t = closest_on_spline(points, x)
    found = np.einsum("ka,kaj->kj", spline_shape(t), x[piece[:, None] + np.array([-1, 0, 1])])
    shape = spline_shape(np.linspace(0, 1, 401))
    curve = np.concatenate([shape @ x[i - 1 : i + 2] for i in range(1, 60)])
    sampled = cKDTree(curve).query(points)[0]
    distance = np.linalg.norm(found - points, axis=1)
    assert (distance <= sampled + 1e-12).all() and (distance > sampled - 2e-3).all()


def test_failure_is_an_error() -> None:
    with pytest.raises(ConvergenceError, match="unbalanced"):
        solve([EndForce(np.array([0.0, 0.5, 0])), Bend(0.5, 1.0)], straight(60), RodOptions(max_iterations=2))


def test_bishop_normals_of_a_planar_curve_keep_to_the_plane() -> None:
    s = np.linspace(0, 5, 80)
    x = np.stack([s * 6, 8 * np.sin(s), np.zeros_like(s)], axis=1)
    np.testing.assert_allclose(
        bishop_normals(x, np.array([0, 0, 1.0])), np.tile([0, 0, 1.0], (79, 1)), atol=1e-12
    )


def test_bishop_normals_of_a_helix_turn_with_its_torsion() -> None:
    """Against the Frenet normal, a parallel frame turns by minus torsion times arc length."""
    a, b, s = 5.0, 2.0, np.linspace(0, 6, 3000)
    x = np.stack([a * np.cos(s), a * np.sin(s), b * s], axis=1)
    middle = 0.5 * (s[1:] + s[:-1])
    frenet = np.stack([-np.cos(middle), -np.sin(middle), 0 * middle], axis=1)
    d = directions(x)
    parallel = bishop_normals(x, frenet[0])
    angle = np.unwrap(
        np.arctan2(np.sum(parallel * np.cross(d, frenet), axis=1), np.sum(parallel * frenet, axis=1))
    )
    turned = -b / (a**2 + b**2) * np.hypot(a, b) * (middle - middle[0])
    np.testing.assert_allclose(angle, turned, atol=1e-3)
    assert abs(perpendicular(d[0]) @ d[0]) < 1e-12
