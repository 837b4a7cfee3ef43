"""Shapes move off bones alone, and scenes without an initial guess are counted."""

import numpy as np
import pytest
import trimesh
from benchmarks.disjoint_start.draws import Result, figures, initial_guess, varied

from handpipe.mesh.surfaces.surface import Surface
from handpipe.tissues.muscles.fitting.soft_body import SoftBody


def ball(x: float, z: float) -> SoftBody:
    """A muscle of radius 3 mm whose lowest vertices a bone holds."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=3.0)
    held = {"bone": np.argsort(mesh.vertices[:, 2])[:3]}
    return SoftBody.fill(Surface(np.array(mesh.vertices) + [x, 0.0, z], np.array(mesh.faces)), held, 1.5)


BLOCK = trimesh.creation.box(extents=[30, 30, 4])
BONE = {"bone": Surface(BLOCK.vertices + [0, 0, -5.0], np.array(BLOCK.faces))}  # under balls that touch it


def test_each_muscle_moves_in_its_own_way_and_stays_on_bones():
    muscles = {"left": ball(-4.0, 0.0), "right": ball(-4.0, 0.0)}
    moved, bones = varied((muscles, BONE), 1, 0.5)
    assert bones is BONE
    ways = {n: moved[n].surface.vertices - muscles[n].surface.vertices for n in muscles}
    on_bone = muscles["left"].surface.vertices[:, 2] < -2.99
    for way in ways.values():
        assert np.abs(way[on_bone]).max() < 1e-3 < 0.2 < np.abs(way).max()
    assert np.abs(ways["left"] - ways["right"]).max() > 0.2


def test_balls_that_overlap_are_initial_guess_by_half_of_it_at_least():
    muscles = {"left": ball(-2.5, 0.5), "right": ball(2.5, 0.5)}
    found = initial_guess((muscles, BONE))
    assert found.margin == 0.1 and 0.5 <= found.moved < 2.0


def test_a_failed_scene_has_no_motion_and_enters_no_mean():
    found = figures([Result(0.1, 2.0, 5.0), Result(0.5, 4.0, 9.0), Result(np.inf, np.inf, 40.0)])
    assert [found[f"scenes{kind}"][0] for kind in ("", "_failed", "_with_released_attachments")] == [3, 1, 1]
    assert found["moved_mean"] == (pytest.approx(3.0), "mm") and found["seconds_max"] == (40.0, "s")
