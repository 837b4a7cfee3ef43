"""A ligament follows its bones, rigidly where they move alike and stretched where they part."""

import numpy as np
import pytest
import trimesh
from tests.tissues.muscles.shapes import hinge, hinge_bones, spindle

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame
from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.skeleton.posing.layer import BoneLayer
from handpipe.tissues.ligaments.fitting import fit_ligament
from handpipe.tissues.ligaments.layer import LigamentLayer
from handpipe.tissues.muscles.fitting.template_placement import PlacedTemplate


def layer(attachments=None) -> LigamentLayer:
    body = spindle()
    guess = PlacedTemplate(body.surface, attachments or body.attachments)
    return LigamentLayer([fit_ligament("l", guess, {"b": "a"}, "neutral", edge=2.5)])


def shapes(transforms, attachments=None):
    frame = Frame("pose", {}, transforms)
    return layer(attachments).solve(frame, {"bones": BoneLayer(hinge_bones()).solve(frame, {})})


def solve(transforms):
    return shapes(transforms)["l"]


def test_moves_rigidly_with_both_bones():
    turn = RigidTransform.about(np.array([3.0, 1, 2]), hinge(0.9)["b"].rotation)
    shape = solve({"a": turn, "b": turn})
    assert shape.vertices == pytest.approx(turn(shape.rest), abs=1e-3)


def test_ends_stay_on_their_bones_when_the_joint_bends():
    body, transforms = spindle(), hinge(0.7)
    shape = solve(transforms)
    for bone, ids in body.attachments.items():
        assert np.linalg.norm(shape.vertices[ids] - transforms[bone](shape.rest[ids]), axis=1).max() < 0.3


def test_after_another_frame_it_has_the_same_shape():
    ligaments, frames = layer(), [Frame(name, {}, hinge(angle)) for name, angle in (("a", 0.65), ("b", 0.7))]
    bones = [{"bones": BoneLayer(hinge_bones()).solve(frame, {})} for frame in frames]
    before, alone = (ligaments.solve(frame, below) for frame, below in zip(frames, bones, strict=True))
    found = ligaments.solve_after((frames[0], {**bones[0], "ligaments": before}), frames[1], bones[1])
    assert found["l"].vertices == pytest.approx(alone["l"].vertices, abs=1e-3)
    assert np.abs(before["l"].vertices - alone["l"].vertices).max() > 0.5


def test_a_bone_between_its_ends_keeps_it_out():
    """A third bone comes from the side, by 2 mm into where the ligament lies."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=8.0)
    side = spindle().surface.vertices[:, 1].max()
    centre = np.array([0.0, side + 6.0, 0.0])
    bones = hinge_bones() | {"c": Surface(ball.vertices + [0.0, 30.0, 0.0], ball.faces)}
    near = RigidTransform(np.eye(3), centre - [0.0, 30.0, 0.0])
    frame = Frame("pose", {}, {"a": RigidTransform.identity(), "b": RigidTransform.identity(), "c": near})
    found = layer().solve(frame, {"bones": BoneLayer(bones).solve(frame, {})})["l"]
    depths = 8.0 - np.linalg.norm(found.vertices - centre, axis=1)
    before = 8.0 - np.linalg.norm(found.rest - centre, axis=1)
    assert before.max() > 1.5 and depths.max() < 0.25
    assert found.figures["body_penetration"] == pytest.approx(max(depths.max(), 0.0), abs=0.05)


def test_the_barrier_of_muscles_is_not_for_ligaments():
    assert not layer().behind_barrier().options.barrier


def test_bones_that_part_stretch_it():
    apart = {"a": RigidTransform.identity(), "b": RigidTransform(np.eye(3), np.array([3.0, 0, 0]))}
    shape = solve(apart)
    assert np.ptp(shape.vertices[:, 0]) == pytest.approx(33.0, abs=0.3)
    middle = np.abs(shape.rest[:, 0]) < 4
    assert np.ptp(shape.vertices[middle, 1]) < np.ptp(shape.rest[middle, 1])


def pressed(gap: float, distance: float):
    """All that lies more than `gap` mm from the middle is held; the ends come `distance` mm nearer."""
    x = spindle().surface.vertices[:, 0]
    ends = {"a": np.flatnonzero(x < -gap), "b": np.flatnonzero(x > gap)}
    nearer = RigidTransform(np.eye(3), np.array([-distance, 0, 0]))
    return shapes({"a": RigidTransform.identity(), "b": nearer}, ends)


def test_ends_pressed_into_one_another_give_way_and_invert_no_tet():
    found = pressed(2.5, 6.0)
    mesh, surface = found["l_mesh"], found["l"]
    assert TetMesh(mesh.vertices, mesh.cells).volumes().min() > 0
    x, moved = surface.rest[:, 0], surface.vertices - surface.rest
    assert np.linalg.norm(moved[x < -2.5], axis=1).max() < 0.5
    assert np.linalg.norm(moved[x > 2.5] + [6.0, 0, 0], axis=1).max() < 0.5


def test_ends_that_change_places_have_no_shape():
    with pytest.raises(ConvergenceError, match="tets are inverted, the worst at .* mm has det F"):
        pressed(0.3, 6.0)
