"""A ligament follows its bones, rigidly where they move alike and stretched where they part."""

import numpy as np
import pytest
from tests.muscles.shapes import hinge, hinge_bones, spindle

from handpipe.layers import Frame
from handpipe.ligaments.fitting import fit_ligament
from handpipe.ligaments.layer import LigamentLayer
from handpipe.mesh.rigid import RigidTransform
from handpipe.muscles.templates import Guess
from handpipe.skeleton.layer import BoneLayer


def layer() -> LigamentLayer:
    body = spindle()
    return LigamentLayer(
        [fit_ligament("l", Guess(body.surface, body.attachments), {"b": "a"}, "neutral", edge=2.5)]
    )


def solve(transforms):
    frame = Frame("pose", {}, transforms)
    return layer().solve(frame, {"bones": BoneLayer(hinge_bones()).solve(frame, {})})["l"]


def test_moves_rigidly_with_both_bones():
    turn = RigidTransform.about(np.array([3.0, 1, 2]), hinge(0.9)["b"].rotation)
    shape = solve({"a": turn, "b": turn})
    assert shape.vertices == pytest.approx(turn(shape.rest), abs=1e-3)


def test_ends_stay_on_their_bones_when_the_joint_bends():
    body, transforms = spindle(), hinge(0.7)
    shape = solve(transforms)
    for bone, ids in body.attachments.items():
        assert np.linalg.norm(shape.vertices[ids] - transforms[bone](shape.rest[ids]), axis=1).max() < 0.3


def test_bones_that_part_stretch_it():
    apart = {"a": RigidTransform.identity(), "b": RigidTransform(np.eye(3), np.array([3.0, 0, 0]))}
    shape = solve(apart)
    assert np.ptp(shape.vertices[:, 0]) == pytest.approx(33.0, abs=0.3)
    middle = np.abs(shape.rest[:, 0]) < 4
    assert np.ptp(shape.vertices[middle, 1]) < np.ptp(shape.rest[middle, 1])
