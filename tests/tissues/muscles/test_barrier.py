"""Two muscles pressed together: planes let them cross, a barrier does not."""

from functools import cache

import igl
import numpy as np
import pytest
from tests.tissues.muscles import crossings as exact
from tests.tissues.muscles.shapes import hinge, hinge_bones
from tests.tissues.muscles.test_layer import muscle, solve

from handpipe.core.errors import ConvergenceError, InputError
from handpipe.mesh.surfaces.surface import Surface, each_moved
from handpipe.tissues.muscles import barrier
from handpipe.tissues.muscles.barrier import BARRIER_STIFFNESS, DISTANCE
from handpipe.tissues.muscles.colliding import Bodies, held_vertices
from handpipe.tissues.muscles.layer import MuscleLayer

ANGLE, APART = 0.8, 5.8  # rad; mm between the muscles' axes, which are 6 mm thick


@cache
def layer():
    return MuscleLayer([muscle("low"), muscle("high", (0.0, 0.0, APART))])


@cache
def by_planes():
    return solve(layer(), ANGLE)


@cache
def apart():
    return solve(layer().behind_barrier(), ANGLE)


def surfaces(shapes):
    return [Surface(shapes[n].vertices, shapes[n].cells) for n in ("low", "high")]


def bodies(shapes):
    x = np.concatenate([shapes[f"{n}_mesh"].vertices for n in ("low", "high")])
    return Bodies.of(layer().muscles, layer().surfaces, each_moved(hinge_bones(), hinge(ANGLE)), x), x


def deep(points, surface):
    """Largest depth of points in a surface, by another library."""
    within = np.ascontiguousarray(points[exact.inside(points, surface)])
    squared = igl.point_mesh_squared_distance(within, surface.vertices, surface.triangles)[0]
    return float(np.sqrt(squared).max(initial=0.0))


def test_planes_let_muscles_cross_and_the_figures_say_so(caplog):
    caplog.set_level("INFO")
    shapes = solve(layer(), ANGLE)
    low, high = surfaces(shapes)
    figures = shapes["low"].figures
    assert exact.crossings(low, high) + exact.crossings(high, low) > 0
    depth = max(deep(high.vertices, low), deep(low.vertices, high))
    assert figures["body_penetration"] == pytest.approx(depth) and depth > 0.01
    assert f"muscles of pose: {depth:.2f} mm deep at most: " in caplog.text


def test_behind_the_barrier_they_do_not_cross():
    low, high = surfaces(apart())
    assert exact.crossings(low, high) == exact.crossings(high, low) == 0
    assert not exact.inside(high.vertices, low).any() and not exact.inside(low.vertices, high).any()
    for bone in each_moved(hinge_bones(), hinge(ANGLE)).values():
        assert exact.crossings(low, bone) == 0
    for name in ("low", "high"):
        figures = apart()[name].figures
        assert figures["body_penetration"] == figures["contact_unsettled"] == 0
        off = np.linalg.norm(apart()[name].vertices - by_planes()[name].vertices, axis=1)
        assert off.max() < 0.6 and off.mean() < 0.1


def test_the_force_of_one_on_the_other_is_returned_and_is_the_energys_derivative():
    known, x = bodies(apart())
    young = layer().options.material.young
    barrier = known.barrier(x, layer().elastic.vertices, DISTANCE, BARRIER_STIFFNESS * young)
    assert 0 < barrier.gap(x) < DISTANCE
    force, rng = barrier.gradient(x), np.random.default_rng(0)
    assert np.linalg.norm(force, axis=1).max() > 0.1
    of_low, of_high = (force[part].sum(axis=0) for part in layer().parts)
    on_bones = barrier.obstacle_forces(x).sum(axis=0)
    np.testing.assert_allclose(of_low + of_high, on_bones, atol=1e-9 * np.abs(force).sum())
    if not np.abs(on_bones).any():
        np.testing.assert_allclose(of_low, -of_high, atol=1e-9 * np.abs(force).sum())
    along = rng.normal(size=x.shape)
    slope = (barrier.value(x + 1e-7 * along) - barrier.value(x - 1e-7 * along)) / 2e-7
    assert slope == pytest.approx(np.vdot(force, along), rel=1e-4)


def test_crossings_are_those_of_an_exact_count():
    known, x = bodies(by_planes())
    low, high = surfaces(by_planes())
    found = known.crossings(x)
    between = (np.sort(found.bodies, axis=1) == [0, 1]).all(axis=1)
    assert between.sum() == exact.crossings(low, high) + exact.crossings(high, low)


def test_a_muscle_that_folds_into_itself_is_found_and_is_no_start_of_the_barrier():
    alone = MuscleLayer([muscle("m")], contact=False)
    x = solve(alone, 4.0)["m_mesh"].vertices
    known = Bodies.of(alone.muscles, alone.surfaces, {}, x)
    assert len(known.crossings(x, itself=True).edges) > 0 == len(known.crossings(x).edges)
    with pytest.raises(InputError, match="intersect"):
        known.barrier(x, alone.elastic.vertices, DISTANCE, 1.0)


def test_a_muscle_is_pushed_out_of_a_bone_or_the_frame_fails():
    """Planes leave it 0.5 mm deep in a bone that folds it; farther, it has no room and folds into itself."""
    plain = MuscleLayer([muscle("m")])
    assert solve(plain, 3.3)["m"].figures["body_penetration"] > 0.3
    shape = solve(plain.behind_barrier(), 3.3)["m"]
    assert shape.figures["body_penetration"] == shape.figures["cuts_itself"] == 0
    ends = np.isin(shape.cells, held_vertices(plain.muscles[0])).any(
        axis=1
    )  # which go with bones, through others
    free = Surface(shape.vertices, shape.cells[~ends])
    for bone in each_moved(hinge_bones(), hinge(3.3)).values():
        assert exact.crossings(free, bone) == exact.crossings(bone, free) == 0
    with pytest.raises(ConvergenceError, match=r"muscles of pose .* around \(.*\) mm"):
        solve(plain.behind_barrier(), 4.0)


def test_without_room_the_frame_fails_and_names_the_muscles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two muscles in one place: one push does not part them; several may, as rounding decides."""
    monkeypatch.setattr(barrier, "ROUNDS", 1)
    crowded = MuscleLayer([muscle("low"), muscle("high", (0.0, 0.0, 0.3))]).behind_barrier()
    with pytest.raises(ConvergenceError, match=r"most of high around \(.*\) mm.*bend less"):
        solve(crowded, ANGLE)
