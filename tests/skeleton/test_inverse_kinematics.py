"""Inverse kinematics against poses that another formula made, and its Jacobian against differences."""

import numpy as np
import pytest
from five_fingers import posed, random_angles, rig, tips

from handpipe.core.errors import InputError
from handpipe.skeleton.posing.inverse_kinematics import ReachOptions, solve
from handpipe.skeleton.posing.targets import Direction, Meeting, Orientation, Position
from handpipe.skeleton.rig.twists import moving_bones

RIG = rig()
TIPS = tips()


@pytest.mark.parametrize("model", ["full", "partial"])
@pytest.mark.parametrize("share", [0.7, 1.3])  # within the residuals' range and beyond
def test_twists_are_the_derivatives_of_the_transforms(model, share):
    angles, h = random_angles(1, share), 1e-6
    bones = moving_bones(RIG, angles, model=model)
    plain = RIG.bone_transforms(angles, model=model)
    for k, name in enumerate(RIG.angle_names):
        ahead = RIG.bone_transforms(angles | {name: angles[name] + h}, model=model)
        back = RIG.bone_transforms(angles | {name: angles[name] - h}, model=model)
        for bone, moving in bones.items():
            assert np.array_equal(moving.transform.rotation, plain[bone].rotation)
            point = RIG.surfaces[bone].vertices[0]
            difference = (ahead[bone](point) - back[bone](point)) / (2 * h)
            assert np.allclose(moving.velocities(point)[k], difference, atol=2e-6)


@pytest.mark.parametrize(
    "target",
    [
        Position("distal2", TIPS[2], np.array([90.0, 10, -30]), weight=0.7),
        Orientation("distal1", np.eye(3)),
        Direction("proximal4", TIPS[4] - [20.0, 3, 5], "distal4", TIPS[4], np.array([0, 0, -1.0])),
        Meeting("distal1", TIPS[1], "distal3", TIPS[3]),
    ],
    ids=lambda t: type(t).__name__,
)
def test_targets_derivatives_agree_with_differences(target):
    angles, h = random_angles(2), 1e-6
    jacobian = target.residual(moving_bones(RIG, angles))[1]
    for k, name in enumerate(RIG.angle_names):
        ends = [target.residual(moving_bones(RIG, angles | {name: angles[name] + s}))[0] for s in (h, -h)]
        assert np.allclose(jacobian[:, k], (ends[0] - ends[1]) / (2 * h), atol=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_tips_that_another_formula_placed_are_reached_from_neutral(seed):
    truth = random_angles(seed)
    targets = [Position(f"distal{d}", TIPS[d], posed(TIPS[d], f"distal{d}", truth)[0]) for d in TIPS]
    found = solve(RIG, targets)
    assert found.reached and max(found.distances) < 0.02 and not found.at_limits
    for target in targets:
        place = posed(target.point, target.bone, found.angles)[0]
        assert np.linalg.norm(place - target.place) < 0.02
    for name, (lower, upper) in RIG.limits.items():
        assert lower <= found.angles[name] <= upper


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_positions_with_orientations_give_back_the_angles(seed):
    truth = random_angles(seed)
    targets = []
    for d in TIPS:
        place, rotation = posed(TIPS[d], f"distal{d}", truth)
        targets += [Position(f"distal{d}", TIPS[d], place), Orientation(f"distal{d}", rotation)]
    found = solve(RIG, targets, options=ReachOptions(rest_weight=1e-4))
    assert found.reached
    assert found.angles == pytest.approx(truth, abs=2e-3)


def test_a_target_beyond_the_bones_says_how_far():
    centre = np.array([66.0, 22.0, 0.0])
    plain = rig(residuals=False)
    tip = TIPS[2]
    start = np.linalg.norm(tip - centre)
    found = solve(plain, [Position("distal2", tip, tip + [30.0, 0, 0])])
    assert not found.reached
    # The finger can at most be stretched: what is left is the distance beyond its length.
    assert found.distances[0] == pytest.approx(np.linalg.norm(tip + [30, 0, 0] - centre) - start, abs=0.8)
    assert "are left" in str(found)


def test_the_limit_that_holds_is_named():
    plain = rig(residuals=False)
    beyond = dict.fromkeys(plain.angle_names, 0.0) | {"PIP3_flexion": np.radians(125)}
    place, rotation = posed(TIPS[3], "middle3", beyond, residuals=False)
    fixed = {n: (0.0, 0.0) for n in plain.angle_names if n != "PIP3_flexion"}
    found = solve(plain, [Position("middle3", TIPS[3], place)], limits=fixed)
    assert list(found.at_limits) == ["PIP3_flexion"] and found.at_limits["PIP3_flexion"] == pytest.approx(
        np.radians(110)
    )
    arm = np.linalg.norm((TIPS[3] - [108.0, 2, 0.5])[[0, 2]])
    assert found.distances[0] == pytest.approx(2 * arm * np.sin(np.radians(7.5)), rel=0.02)
    assert "PIP3_flexion at its limit of 110.0 deg" in str(found)


@pytest.mark.parametrize("digit", [2, 3, 4, 5])
def test_the_thumb_opposes_every_finger(digit):
    found = solve(RIG, [Meeting("distal1", TIPS[1], f"distal{digit}", TIPS[digit])])
    assert found.distances[0] < 0.5, str(found)


def test_what_targets_leave_free_stays_at_rest():
    rest = {"PIP5_flexion": 0.6, "MP4_abduction": -0.1}
    found = solve(RIG, [Position("distal2", TIPS[2], np.array([120.0, 20, -60]))], rest=rest)
    assert found.angles["PIP5_flexion"] == pytest.approx(0.6, abs=1e-6)
    assert found.angles["MP4_abduction"] == pytest.approx(-0.1, abs=1e-6)
    assert found.angles["MP3_flexion"] == pytest.approx(0, abs=1e-6)


def test_mirrored_targets_give_the_same_angles_on_the_mirrored_hand():
    left, mirror = rig(mirrored=True), np.array([1.0, -1, 1])
    truth = random_angles(21)
    targets = [Position(f"distal{d}", TIPS[d], posed(TIPS[d], f"distal{d}", truth)[0]) for d in TIPS]
    mirrored = [Position(t.bone, t.point * mirror, t.place * mirror) for t in targets]
    assert solve(left, mirrored).angles == pytest.approx(solve(RIG, targets).angles, abs=1e-6)


def test_wrong_input():
    with pytest.raises(InputError, match="no bone 'distal9'"):
        solve(RIG, [Position("distal9", np.zeros(3), np.zeros(3))])
    with pytest.raises(InputError, match="MP2_flexion: lower above upper"):
        solve(RIG, [], limits={"MP2_flexion": (1.0, 0.0)})
