"""Two fingers on a palm: what varies over them follows the joints nearby, and no others."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.posing.local_pose_spaces import LocalPoseSpaces

PARENTS = {"index1": "palm", "index2": "index1", "index3": "index2", "little1": "palm", "little2": "little1"}
BONES = ("palm", *PARENTS)
EXAMPLES = {"open": (0.0, 0.0), "index": (1.0, 0.0), "little": (0.0, 1.0)}


def bent(index, little):
    """All joints of a finger bent by an angle in rad, about axes through the origin."""
    turn = {"palm": 0.0, "index1": 1, "index2": 2, "index3": 3, "little1": 1, "little2": 2}
    angles = {bone: turn[bone] * (index if bone.startswith("index") else little) for bone in BONES}
    return {
        b: RigidTransform(Rotation.from_rotvec([0, a, 0]).as_matrix(), np.zeros(3)) for b, a in angles.items()
    }


@pytest.fixture(params=["inverse-distance", "rbf"])
def spaces(request):
    poses = {name: bent(*angles) for name, angles in EXAMPLES.items()}
    return LocalPoseSpaces.build(BONES, PARENTS, poses, request.param)


VALUES = np.array([[[0.0], [0.0]], [[2.0], [0.0]], [[0.0], [3.0]]])  # at a place on index3 and one on little2
NEAR = {"index3": np.array([1.0, 0.0]), "little2": np.array([0.0, 1.0])}


def test_examples_are_met(spaces):
    for values, angles in zip(VALUES, EXAMPLES.values(), strict=True):
        np.testing.assert_allclose(spaces.interpolate(VALUES, NEAR, bent(*angles)), values, atol=1e-9)


def test_each_finger_follows_its_own_joints(spaces):
    """Both bent is no example; each finger is as in the example that bends it."""
    np.testing.assert_allclose(spaces.interpolate(VALUES, NEAR, bent(1.0, 1.0)), [[2.0], [3.0]], atol=1e-9)
    half = spaces.interpolate(VALUES, NEAR, bent(0.5, 0.0))
    also = spaces.interpolate(VALUES, NEAR, bent(0.5, 0.8))
    assert half[0] == pytest.approx(also[0], abs=1e-9) and 0.3 < half[0, 0] < 1.7


def test_a_place_does_not_follow_a_joint_farther_off_where_nearer_ones_tell():
    """A hook: its base straight, its end bent as in the fist. At the tip that is the fist, at the palm the
    open hand."""

    def finger(base, end):
        angles = {"palm": 0.0, "index1": base, "index2": base + end, "index3": base + 1.5 * end}
        return {
            b: RigidTransform(Rotation.from_rotvec([0, a, 0]).as_matrix(), np.zeros(3))
            for b, a in angles.items()
        }

    poses = {"open": finger(0.0, 0.0), "fist": finger(1.2, 1.2), "flat": finger(0.9, 0.1)}
    bones = ("palm", "index1", "index2", "index3")
    spaces = LocalPoseSpaces.build(bones, {b: PARENTS[b] for b in bones[1:]}, poses, "rbf")
    values = np.array([[[0.0]] * 2, [[1.0]] * 2, [[0.0]] * 2])
    near = {"index3": np.array([1.0, 0.0]), "palm": np.array([0.0, 1.0])}
    tip, palm = spaces.interpolate(values, near, finger(0.0, 1.2))[:, 0]
    assert tip == pytest.approx(1.0, abs=1e-9) and palm == pytest.approx(0.0, abs=1e-9)


def test_a_place_between_bones_has_a_share_of_each(spaces):
    near = {"index3": np.array([0.25]), "little2": np.array([0.75])}
    values = np.array([[[0.0]], [[4.0]], [[8.0]]])
    np.testing.assert_allclose(spaces.interpolate(values, near, bent(1.0, 1.0)), [[0.25 * 4 + 0.75 * 8]])


def test_a_group_keeps_everything(spaces):
    again = LocalPoseSpaces.from_group(spaces.to_group())
    pose = bent(0.3, 0.6)
    np.testing.assert_array_equal(
        again.interpolate(VALUES, NEAR, pose), spaces.interpolate(VALUES, NEAR, pose)
    )


def test_bones_far_from_all_examples_are_named():
    poses = {name: bent(*angles) for name, angles in (("open", (0, 0)), ("a", (0.2, 0.3)), ("b", (0.1, 0.5)))}
    spaces = LocalPoseSpaces.build(BONES, PARENTS, poses, "rbf")
    assert spaces.extrapolated(bent(0.15, 0.4)) == []
    assert spaces.extrapolated(bent(0.2, 1.5)) == ["palm", "little1", "little2"]
