"""A ligament follows its bones, rigidly where they move alike and stretched where they part."""

import numpy as np
import pytest
from tests.tissues.muscles.shapes import hinge, hinge_bones, spindle

from handpipe.core.errors import ConvergenceError
from handpipe.core.layers import Frame
from handpipe.core.rigid import RigidTransform
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
