"""Where the coupled hand's bones go, and what counts as a skin that passes through itself."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from benchmarks.truth import toy
from tests.fem.bodies import sphere

from handpipe.core.errors import InputError
from handpipe.synthetic.continuum.surfaces import outer_faces
from handpipe.synthetic.phantom import phantom_hand
from handpipe.synthetic.phantom.phantom_hand_joints import POSES, joints
from handpipe.synthetic.phantom.posed_hand import HandMotion
from handpipe.synthetic.template_hands import coupled_hand

MOTION = HandMotion("phantom-hand", joints(), POSES)


def test_bones_go_where_the_bones_alone_have_them():
    """All but the root's place in the scanner is that of `phantom-hand`."""
    for pose in ("fist", "oppose_little"):
        posture = phantom_hand.posture(pose, 1)
        found, seen = coupled_hand.bones_at(MOTION, pose), posture.transforms()
        assert set(found) == set(seen) == set(phantom_hand.hand().bones)
        for bone, transform in found.items():
            there = posture.root @ transform
            np.testing.assert_allclose(there.rotation, seen[bone].rotation, atol=1e-12)
            np.testing.assert_allclose(there.translation, seen[bone].translation, atol=1e-9)


def test_a_share_of_a_pose_is_on_the_way_to_it():
    rest, half, whole = (
        coupled_hand.bones_at(MOTION, "fist", share)["proximal3"] for share in (0.0, 0.5, 1.0)
    )
    np.testing.assert_allclose(rest.rotation, np.eye(3), atol=1e-12)
    turned, all_of_it = half.angle_to(rest), whole.angle_to(rest)
    assert np.degrees(all_of_it) == pytest.approx(POSES["fist"]["MP3_flexion"], abs=5)
    assert turned == pytest.approx(all_of_it / 2, rel=0.1)


def test_the_way_from_one_pose_to_another_starts_and_ends_at_them():
    for share, pose in ((0.0, "spread"), (1.0, "relaxed")):
        found, wanted = (
            coupled_hand.bones_at(MOTION, "relaxed", share, "spread"),
            coupled_hand.bones_at(MOTION, pose),
        )
        for bone, transform in found.items():
            np.testing.assert_allclose(transform.rotation, wanted[bone].rotation, atol=1e-12)
            np.testing.assert_allclose(transform.translation, wanted[bone].translation, atol=1e-9)


def test_a_joint_that_opens_through_the_skin_is_named():
    """A bone that takes a triangle of the skin leaves a hole there."""
    anatomy = toy.finger(5.0)
    coupled_hand.require_closed_skin(anatomy, "toy")
    hole = outer_faces(anatomy.mesh, anatomy.bones.values())[0]
    holed = replace(anatomy, bones={**anatomy.bones, "third": hole})
    with pytest.raises(InputError, match=r"toy: skin: is open along \d+ edges"):
        coupled_hand.require_closed_skin(holed, "toy")


@pytest.mark.parametrize(("apart", "cut"), [(1.5, True), (2.5, False)])
def test_two_balls_of_one_skin_cut_it_where_they_meet(apart, cut):
    points, triangles = sphere(1.0, 2)
    x = np.concatenate([points, points + [apart, 0.01, 0.02]])
    body = SimpleNamespace(skin_faces=np.concatenate([triangles, triangles + len(points)]))
    assert coupled_hand.cuts_itself(body, x) is cut
