"""Bones in the wrong place, of the wrong shape or wrongly turned are noticed, and only those."""

import numpy as np
import pytest
from manufactured import bone, off_by, turn
from test_rig import AXES, DATASET, FIT, LENGTHS, manufactured

from handpipe.core import artifacts
from handpipe.core.errors import ConvergenceError, InputError
from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.bones.bone_files import read_registration
from handpipe.skeleton.bones.registration_result import Registration, read_registrations, write_registrations
from handpipe.skeleton.registration.doubts import blame, doubted, odd_joints
from handpipe.skeleton.registration.odd_bones import odd_motions, without_odd_bones
from handpipe.skeleton.registration.pose_registration import register_pose, unmoved

COARSE = bone(24, 20)
SURFACES = {b: COARSE.moved(COARSE.vertices + [x, 0, 0]) for b, x in LENGTHS.items()}
JOINTS = {"MP": ("a", "b"), "PIP": ("b", "c"), "DIP": ("c", "d")}
SMALL = 1e-6 * np.eye(6)


def rolled(transform, name, degrees):
    """The transform after a turn of the neutral bone about its own long axis."""
    middle = SURFACES[name].vertices.mean(axis=0)
    return transform @ RigidTransform.about(middle, turn(np.radians([degrees, 0, 0])))


def registrations(transforms, **rms):
    return {b: Registration(t, rms.get(b, 0.03), SMALL) for b, t in transforms.items()}


def reasons(found):
    return {b: r.doubt for b, r in found.items() if r.doubt}


def test_good_bones_are_not_doubted():
    for pose, transforms in manufactured(glide=1.0, degrees=0.2, mm=0.05).items():
        assert not reasons(doubted(registrations(transforms), SURFACES, DATASET.joints)), pose


@pytest.mark.parametrize("name", ["metacarpal2", "proximal2", "middle2", "distal2"])
def test_a_bone_beside_its_place_is_blamed_alone(name):
    transforms = dict(manufactured()["bow"])
    transforms[name] = RigidTransform(np.eye(3), np.array([0, 19.0, 0])) @ transforms[name]
    found = reasons(doubted(registrations(transforms), SURFACES, DATASET.joints))
    assert list(found) == [name] and "open" in found[name]


@pytest.mark.parametrize("name", ["proximal2", "distal2"])
def test_a_bone_turned_about_its_long_axis_is_blamed_alone(name):
    transforms = dict(manufactured()["hook"])
    transforms[name] = rolled(transforms[name], name, 180)
    found = reasons(doubted(registrations(transforms), SURFACES, DATASET.joints))
    assert list(found) == [name] and "twisted" in found[name]


def test_bones_that_move_as_one_do_not_turn_against_one_another():
    joint = DATASET.joints["PIP2"].model_copy(update={"angles": (), "limits_deg": (), "axis_hints": ()})
    transforms = dict.fromkeys(SURFACES, RigidTransform.identity())
    transforms["middle2"] = rolled(transforms["middle2"], "middle2", 20)
    joints = {"PIP2": joint, "DIP2": DATASET.joints["DIP2"]}
    found = odd_joints(registrations(transforms), SURFACES, joints)
    assert len(found) == 1 and "twisted by 20 deg" in next(iter(found.values()))


def test_a_residual_far_above_the_others_is_doubted():
    transforms = manufactured()["fist"]
    found = reasons(doubted(registrations(transforms, middle2=0.35), SURFACES, DATASET.joints))
    assert list(found) == ["middle2"] and "0.35 mm" in found["middle2"]
    even = dict.fromkeys(transforms, 0.35)  # a noisy image makes all of them large
    assert not reasons(doubted(registrations(transforms, **even), SURFACES, DATASET.joints))


@pytest.mark.parametrize(
    ("odd", "fault"),
    [(("MP", "PIP"), {"b"}), (("PIP", "DIP"), {"c"}), (("DIP",), {"d"}), (("MP",), {"a"}), ((), set())],
)
def test_the_fewest_bones_that_explain_all_are_blamed(odd, fault):
    assert set(blame(odd, JOINTS)) == fault


def test_one_pose_that_the_others_disagree_with():
    """Thirty degrees of roll lie within what rough hints allow, not within what six poses agree on."""
    transforms = manufactured(glide=1.0, degrees=0.2, mm=0.05)
    good, none = without_odd_bones(DATASET, transforms, SURFACES, FIT)
    assert not none and good == transforms
    wrong = {p: dict(t) for p, t in transforms.items()}
    for pose, name in (("curl", "middle2"), ("half", "distal2")):
        wrong[pose][name] = rolled(wrong[pose][name], name, 30)
    left, found = without_odd_bones(DATASET, wrong, SURFACES, FIT)
    assert set(found) == {("curl", "middle2"), ("half", "distal2")}
    assert "middle2" not in left["curl"] and "distal2" in left["curl"]


def test_too_few_poses_cannot_outvote_one():
    hinge = AXES["PIP2"][0]
    poses = {f"p{i}": turn(hinge * a) for i, a in enumerate((0.3, 0.9))} | {"odd": turn([0.6, 0.3, 0.2])}
    assert odd_motions(poses, list(poses), hinge[None]) == {}
    more = poses | {f"q{i}": turn(hinge * a) for i, a in enumerate((0.6, 1.2))}
    assert set(odd_motions(more, list(more), hinge[None])) == {"odd"}


def test_a_pose_without_one_bone_and_with_a_wrong_one(tmp_path):
    """The chain goes on: what is missing is absent, what fits nowhere is left out, the rest is found."""
    truth = manufactured()["spread"]
    target = {b: COARSE.moved(truth[b](SURFACES[b].vertices)) for b in SURFACES}
    del target["middle2"]
    ball = 30 * COARSE.vertices / np.linalg.norm(COARSE.vertices, axis=1)[:, None]
    target["distal2"] = COARSE.moved(ball)
    found = register_pose(DATASET, SURFACES, target)
    assert set(found) == {"metacarpal2", "proximal2"} and not reasons(found)
    for name, registration in found.items():
        assert np.degrees(registration.transform.angle_to(truth[name])) < 0.1
    write_registrations(tmp_path / "pose.h5", found)
    again = read_registrations(tmp_path / "pose.h5")
    assert list(again) == list(found)
    for name in found:
        assert np.array_equal(again[name].transform.rotation, found[name].transform.rotation)
        assert again[name].rotation_deviation == found[name].rotation_deviation
    with pytest.raises(ConvergenceError, match="no bone"):
        register_pose(DATASET, SURFACES, {})


def test_neutral_is_where_it_is():
    for registration in unmoved(SURFACES).values():
        assert np.array_equal(registration.transform.rotation, np.eye(3))
        assert registration.rotation_deviation == 0 and not registration.doubt


def test_deviation_of_a_point_off_the_middle():
    """Against many draws of the small motion itself."""
    rng = np.random.default_rng(0)
    root = rng.normal(size=(6, 6)) * np.array([0.01] * 3 + [0.1] * 3)[:, None]
    registration = Registration(RigidTransform.identity(), 0.03, root @ root.T)
    arm = np.array([12.0, -3, 5])
    drawn = rng.normal(size=(20000, 6)) @ root.T
    shift = drawn[:, 3:] + np.cross(drawn[:, :3], arm)
    assert registration.deviation_at(arm) == pytest.approx(np.sqrt((shift**2).sum(axis=1).mean()), rel=0.02)


def test_a_missing_bone_is_named_where_it_is_needed(tmp_path):
    path = tmp_path / "fist.h5"
    artifacts.write(
        path, {"middle2": {"rotation": np.eye(3), "translation": np.zeros(3)}}, kind="registration"
    )
    assert set(read_registration(path)) == {"middle2"}
    with pytest.raises(InputError, match=r"fist.h5: distal2: .*scribbles"):
        read_registration(path, ["middle2", "distal2"])


@pytest.mark.parametrize("seed", range(6))
def test_hints_thirty_degrees_off_doubt_no_good_bone(seed):
    rng = np.random.default_rng(seed)
    rough = {
        n: j.model_copy(update={"axis_hints": tuple(map(tuple, off_by(rng, 30.0, j.axis_hints)))})
        for n, j in DATASET.joints.items()
    }
    for pose, transforms in manufactured(glide=1.0, degrees=0.3, mm=0.05).items():
        assert not reasons(doubted(registrations(transforms), SURFACES, rough)), pose
    transforms = dict(manufactured()["hook"])
    transforms["proximal2"] = rolled(transforms["proximal2"], "proximal2", 180)
    assert list(reasons(doubted(registrations(transforms), SURFACES, rough))) == ["proximal2"]
