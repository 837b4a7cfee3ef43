"""Overlapping bodies come apart, keep their volume, change smoothly and do not move where nothing touches."""

import re
from itertools import permutations

import numpy as np
import pytest
import trimesh
from tests.mesh.shapes import folded_ball
from tests.tissues.muscles.crossings import crossings, inside
from tests.tissues.muscles.shapes import hairpin

from handpipe.core.errors import ConvergenceError
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.muscles.separation.separation import NO_VOLUME, SeparationOptions, separate


def ellipsoid(radii, centre, subdivisions: int = 3) -> Surface:
    sphere = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Surface(sphere.vertices * radii + centre, sphere.faces)


def pair() -> dict[str, Surface]:
    return {"a": ellipsoid([25, 5, 4], [0, 0, 0]), "b": ellipsoid([22, 5, 4], [4, 1, 7.0])}


def assert_apart(surfaces, bones=()) -> None:
    """No edge passes through a triangle, and no vertex is inside."""
    muscles = list(surfaces.values())
    for i, one in enumerate(muscles):
        for other in (*muscles[:i], *muscles[i + 1 :], *bones):
            assert crossings(one, other) == 0 and crossings(other, one) == 0
            assert not inside(one.vertices, other).any()


def test_two_muscles_come_apart_and_keep_their_volume():
    muscles = pair()
    result = separate(muscles, {})
    assert result.penetration_before > 0.5 and result.penetration == 0
    assert_apart(result.surfaces)
    for name, other in (("a", "b"), ("b", "a")):
        surface, start = result.surfaces[name], muscles[name]
        assert surface.volume() == pytest.approx(start.volume(), rel=0.01)
        moved = np.linalg.norm(surface.vertices - start.vertices, axis=1)
        far = Distance(muscles[other]).closest(start.vertices)[0] > 6
        assert far.sum() > 50 and moved[far].max() < 0.08  # of the volume given back
        assert moved.max() > 0.2  # each of the two gave way
    gap = Distance(result.surfaces["b"]).closest(result.surfaces["a"].vertices)[0].min()
    assert gap < 0.06  # and no further than it must


def test_visible_vertices_stay_and_hidden_ones_move():
    """2 mm too thick where they touch: if volumes were kept, outer sides would give what inner ones lack."""
    muscles = {"a": ellipsoid([25, 5, 4], [0, 0, 0]), "b": ellipsoid([25, 5, 4], [0, 0, 6.0])}
    visible = {"a": muscles["a"].vertices[:, 2] < 1, "b": muscles["b"].vertices[:, 2] > 5}

    def moved(result) -> float:
        offsets = [result.surfaces[n].vertices[visible[n]] - muscles[n].vertices[visible[n]] for n in muscles]
        return float(np.linalg.norm(np.concatenate(offsets), axis=1).mean())

    result = separate(muscles, {}, NO_VOLUME, visible=visible)
    assert_apart(result.surfaces)
    assert moved(result) < 0.02 < 0.1 < moved(separate(muscles, {}))
    border = result.surfaces["a"].vertices
    border = border[(np.abs(border[:, 0]) < 12) & (np.abs(border[:, 1]) < 1) & (border[:, 2] > 2)]
    np.testing.assert_allclose(border[:, 2], 3.0, atol=0.1)  # midway


def test_smooth_where_it_was_pushed():
    muscles = pair()
    result = separate(muscles, {})
    for name, start in muscles.items():
        ends = start.edges()
        shift = result.surfaces[name].vertices - start.vertices
        slope = np.linalg.norm(shift[ends[:, 0]] - shift[ends[:, 1]], axis=1)
        slope /= np.linalg.norm(start.vertices[ends[:, 0]] - start.vertices[ends[:, 1]], axis=1)
        assert slope.max() < 0.35


def test_a_bone_stays_and_the_muscle_gives_way():
    bone = ellipsoid([30, 5, 5], [0, 0, -8.2])
    result = separate({"a": ellipsoid([25, 5, 4], [0, 0, 0])}, {"bone": bone})
    assert result.penetration_before > 0.5
    assert_apart(result.surfaces, [bone])


def test_apart_is_left_alone():
    muscles = {"a": ellipsoid([25, 5, 4], [0, 0, 0]), "b": ellipsoid([22, 5, 4], [4, 1, 9.0])}
    result = separate(muscles, {})
    for name, start in muscles.items():
        assert np.array_equal(result.surfaces[name].vertices, start.vertices)


def test_three_muscles_in_one_place_on_a_bone():
    muscles = {
        "a": ellipsoid([20, 5, 3], [0, 0, 0]),
        "b": ellipsoid([20, 5, 3], [2, 3.5, 4.2]),
        "c": ellipsoid([20, 5, 3], [-2, 7.5, 0.3]),
    }
    bone = ellipsoid([30, 5, 5], [0, 3, -6.8])
    result = separate(muscles, {"bone": bone})
    assert_apart(result.surfaces, [bone])
    for name, start in muscles.items():
        assert result.surfaces[name].volume() == pytest.approx(start.volume(), rel=0.01)


def test_attached_vertices_stay_inside_the_bone():
    bone = ellipsoid([30, 5, 5], [0, 0, -8.2])
    muscle = ellipsoid([25, 5, 4], [0, 0, 0])
    depth = -Distance(bone).signed(muscle.vertices)[0]
    attached = np.flatnonzero((depth > 0) & (muscle.vertices[:, 0] > 2))
    result = separate({"a": muscle}, {"bone": bone}, attached={"a": attached})
    found = result.surfaces["a"].vertices
    assert len(attached) > 5 and np.array_equal(found[attached], muscle.vertices[attached])
    free = np.setdiff1d(np.arange(len(found)), attached)
    assert not inside(found[free], bone).any()


@pytest.mark.parametrize("seed", [2, 5, 13, 22, 25])
def test_thin_coarse_muscles_across_one_another_on_a_bone(seed):
    """Deep enough that the nearest way out of the other is, for many points, the way through it."""
    rng = np.random.default_rng(seed)
    centre = [rng.uniform(6, 9), rng.uniform(-1, 1), rng.uniform(-0.9, 0.9)]
    across = trimesh.transformations.rotation_matrix(rng.uniform(0, 2), [0, 0, 1])[:3, :3]
    other = ellipsoid([8, 1.0, 1.5], [0, 0, 0], 2)
    muscles = {
        "a": ellipsoid([10, 1.2, 1.0], [0, 0, 0], 2),
        "b": other.moved(other.vertices @ across.T + centre),
    }
    bone = ellipsoid([20, 4, 4], [0, 0, -5.0], 3)
    found = separate(muscles, {"bone": bone})
    assert found.penetration_before > 0.4
    assert_apart(found.surfaces, [bone])
    for name, start in muscles.items():
        assert found.surfaces[name].volume() == pytest.approx(start.volume(), rel=0.01)


@pytest.mark.parametrize("options", [NO_VOLUME, None])
def test_a_leg_that_is_pushed_against_the_other_moves_it(options):
    """A bone is 0.7 mm deep in one leg of a bent muscle; the legs are 0.2 mm apart."""
    muscle, sides = hairpin(0.9, 3)
    bone = ellipsoid([1.2, 6, 1.2], [4.0, 0, 2.2])
    found = separate({"muscle": muscle}, {"bone": bone}, options).surfaces
    assert_apart(found, [bone])
    vertices = found["muscle"].vertices
    for one, other in permutations(sides, 2):
        assert crossings(Surface(vertices, one), Surface(vertices, other)) == 0
    fell = (muscle.vertices - vertices)[sides[0].ravel(), 2]  # the other leg's outer side
    assert fell.max() > 0.05


def test_says_what_cannot_be_separated():
    bone = ellipsoid([20, 6, 6], [0, 0, 0])
    with pytest.raises(ConvergenceError, match="lost and bone"):
        separate({"lost": ellipsoid([10, 2, 2], [0, 0, 1.0], 2)}, {"bone": bone})


def test_a_solve_that_is_stopped_is_no_separation():
    with pytest.raises(ConvergenceError, match="Separation of muscles did not converge"):
        separate(pair(), {}, SeparationOptions(volume=np.inf, iterations=0))


def test_a_muscle_that_cuts_itself_afterwards_is_named(caplog):
    """A folded ball and an ellipsoid that overlap beside the fold: it grows back to its given fold."""
    folded = folded_ball()
    found = separate({"folded": folded, "other": ellipsoid([6, 3, 3], [9.5, 0, 0])}, {}, NO_VOLUME)
    assert_apart(found.surfaces)
    assert re.search(r"folded cuts itself at \d+ vertices, around \(.*, -[45]\.\d\) mm", caplog.text)
    assert "other cuts" not in caplog.text
