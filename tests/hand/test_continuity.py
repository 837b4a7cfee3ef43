"""Steps between manufactured frames: rigid turns are explained by bones, a jump is not and is named."""

import numpy as np
import pytest

from handpipe.core.layers import Frame, Shape
from handpipe.core.rigid import RigidTransform
from handpipe.evaluation.frames import frame_warnings
from handpipe.hand.continuity import POP, Continuity, continuity_metrics
from handpipe.mesh.surfaces.surface import Surface

PLAIN = {"beyond": 0.0, "angle": "", "distance": 1.0, "nearest": "fist", "depth": 0.0, "bones": ""}
TRIANGLE = np.array([[0, 1, 2]])
FIXED = Surface(np.array([[0.0, 0, 0], [20, 0, 0], [0, 1, 0]]), TRIANGLE)
MOVING = Surface(np.array([[20.0, 0, 0], [60, 0, 0], [20, 1, 0]]), TRIANGLE)
REST = np.column_stack([np.linspace(0, 60, 25), np.full(25, 8.0), np.zeros(25)])  # skin above both bones


def turn(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return RigidTransform.about(np.array([20.0, 0, 0]), np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))


def frame(degrees, bump=0.0, layer="fat"):
    """The skin follows the nearer bone, blended over 10 mm; one vertex of it is moved by a bump in mm."""
    bones = {"fixed": RigidTransform.identity(), "moving": turn(degrees)}
    share = np.clip((REST[:, 0] - 15) / 10, 0, 1)[:, None]
    vertices = (1 - share) * REST + share * bones["moving"](REST)
    vertices[20] += [0, 0, bump]
    skin = Shape(REST, vertices, TRIANGLE)
    return Frame(f"f{degrees:g}", {"hinge": np.radians(degrees)}, bones), {layer: {"skin": skin}}


def steps(*frames):
    continuity = Continuity({"fixed": FIXED, "moving": MOVING})
    return [continuity.step(*f) for f in frames]


def test_a_rigid_turn_moves_the_farthest_vertex_by_its_lever_and_is_explained():
    first, step = steps(frame(0), frame(2))
    assert first == {}
    lever = np.hypot(40, 8)
    assert step["joint_motion"] == pytest.approx(2.0)
    assert step["move"] == pytest.approx(2 * lever * np.sin(np.radians(1)), rel=1e-9)
    assert step["continuity"] == pytest.approx(step["move"] / 2)
    assert step["unexplained"] < 1e-9 and step["pop"] < 1e-9  # a blend of both bones explains all


@pytest.mark.parametrize("layer", ["fat", "skin", "muscles"])
def test_a_jump_is_named_with_its_body(layer):
    [_, smooth, jump] = steps(frame(0, layer=layer), frame(1, layer=layer), frame(2, 3.0, layer=layer))
    assert smooth["pop"] < POP < jump["pop"] and jump["pop_body"] == f"{layer} skin"
    assert jump["unexplained"] == pytest.approx(3.0) and jump["pop"] == pytest.approx(3.0)
    rows = [{"frame": name, **PLAIN, **step} for name, step in (("f1", smooth), ("f2", jump))]
    [said] = frame_warnings("wave", rows)
    assert "the shape jumps from the frame before: f2" in said and "3.00 mm" in said
    figures = continuity_metrics([smooth, jump])
    assert figures["pops"] == (1.0, "frames") and figures["pop_max"] == (pytest.approx(3.0), "mm/deg")


def test_a_jump_without_joint_motion_counts_against_half_a_degree():
    _, still, jump = steps(frame(5), frame(5), frame(5, 1.0))
    assert still["continuity"] == 0
    assert jump["joint_motion"] == 0 and jump["pop"] == pytest.approx(1.0 / 0.5)


def test_there_is_no_step_over_a_missing_frame_and_none_without_skin():
    continuity = Continuity({"fixed": FIXED, "moving": MOVING})
    continuity.step(*frame(0))
    continuity.cut()
    assert continuity.step(*frame(30)) == {}
    bare = Continuity({"fixed": FIXED, "moving": MOVING})
    bare.step(frame(0)[0], {})
    assert bare.step(frame(1)[0], {}) == {}
    assert continuity_metrics([{}]) == {}
