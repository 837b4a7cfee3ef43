"""Targets that an independent formula places are met; what cannot be met is said; bones stay apart."""

import numpy as np
import pytest
import yaml
from five_fingers import posed, random_angles, rig, tips

from handpipe.core.errors import InputError
from handpipe.skeleton.drivers.bone_lines import bone_tips
from handpipe.skeleton.motion import expand_motion, motion_frame_names
from handpipe.skeleton.motion.target_motion import TargetSolver
from handpipe.skeleton.posing.targets import Apart
from handpipe.skeleton.posing.validity import PoseValidity
from handpipe.skeleton.rig.twists import moving_bones

RIG = rig()
TIPS = bone_tips(RIG)
TRUTH = random_angles(3, 0.5)
ZERO = dict.fromkeys(RIG.angle_names, 0.0)


def written(folder, keys, **further):
    path = folder / "targets.yaml"
    path.write_text(yaml.safe_dump({"keys": keys, **further}))
    return path


def reach(bone, angles):
    place = posed(TIPS[bone], bone, angles)[0]
    return {"bone": bone, "at": "tip", "to": [float(c) for c in place]}


def distance(motion, frame, bone, place):
    return float(np.linalg.norm(posed(TIPS[bone], bone, motion.frames[frame])[0] - place))


def test_a_tip_comes_to_its_place_at_the_time_of_its_key(tmp_path):
    goal = reach("distal2", TRUTH)
    path = written(tmp_path, [{"time": 0, "name": "rest"}, {"time": 12, "name": "there", "reach": [goal]}])
    motion = expand_motion(path, RIG)
    assert list(motion.frames) == motion_frame_names(path, RIG.limits, RIG.bones)
    assert distance(motion, "there", "distal2", goal["to"]) < 0.5 and not motion.said
    assert motion.figures["there"]["target_distance"] < 0.5
    assert all(a <= f[n] <= b for f in motion.frames.values() for n, (a, b) in RIG.limits.items())
    assert motion.frames["rest"] == pytest.approx(ZERO, abs=1e-6)


def test_a_place_that_two_keys_share_is_followed_between_them(tmp_path):
    first, last = reach("distal2", TRUTH), reach("distal2", {n: 0.6 * v for n, v in TRUTH.items()})
    keys = [{"time": 0, "name": "a", "reach": [first]}, {"time": 10, "name": "b", "reach": [last]}]
    motion = expand_motion(written(tmp_path, keys), RIG)
    for i in range(1, 10):
        line = np.array(first["to"]) + i / 10 * (np.array(last["to"]) - first["to"])
        assert distance(motion, f"a+{i}", "distal2", line) < 1.0
    apart = expand_motion(written(tmp_path, [keys[0], {**keys[1], "reach": [], "angles": {}}]), RIG)
    assert "target_distance" not in apart.figures.get("a+5", {})


def test_thumb_and_index_touch_and_keep_touching(tmp_path):
    pair = [{"bone": "distal1", "at": "tip"}, {"bone": "distal2", "at": "tip"}]
    keys = [
        {"time": 0, "name": "open"},
        {"time": 20, "name": "pinch", "touch": [pair]},
        {"time": 26, "name": "held", "touch": [pair], "angles": {"MP3_flexion": 40}},
    ]
    motion = expand_motion(written(tmp_path, keys), RIG)
    for frame in ("pinch", "pinch+3", "held"):
        angles = motion.frames[frame]
        ends = [posed(TIPS[b], b, angles)[0] for b in ("distal1", "distal2")]
        assert np.linalg.norm(ends[0] - ends[1]) < 2.0  # tips lie a little inside, and bones keep apart
    assert motion.frames["held"]["MP3_flexion"] > np.radians(30)  # free joints keep near the key's own pose


def test_pads_lie_palmar_of_the_bones_by_the_flesh(tmp_path):
    """Two pads that meet keep the bones' lines apart by twice the flesh and the bones' radii, at least."""
    gaps = []
    for flesh in (2.0, 8.0):
        keys = [{"time": 0, "touch": [["distal1", "distal2"]]}, {"time": 1}]
        motion = expand_motion(written(tmp_path, keys, flesh=flesh), RIG)
        angles = motion.frames["key1"]
        assert motion.figures["key1"]["target_distance"] < 1.0
        bones = RIG.bone_transforms(angles)
        a, b = (bones[f"distal{d}"](RIG.surfaces[f"distal{d}"].vertices) for d in (1, 2))
        gaps.append(np.linalg.norm(a[:, None] - b[None], axis=2).min())
    assert gaps[1] > gaps[0] + 3.0


def test_the_back_lies_dorsal_of_the_middle_of_a_bone(tmp_path):
    """2 mm above it: the back of a finger has two fifths of the flesh of its pad."""
    bone = RIG.surfaces["middle2"].vertices
    middle = bone[np.abs(bone[:, 0] - bone[:, 0].mean()) < 4.0]
    above = np.array([*middle[:, :2].mean(axis=0), middle[:, 2].max() + 2.0])  # +z is dorsal
    goal = {"bone": "middle2", "at": "back", "to": [float(c) for c in posed(above, "middle2", TRUTH)[0]]}
    motion = expand_motion(written(tmp_path, [{"time": 0, "reach": [goal]}, {"time": 1}], flesh=5.0), RIG)
    found = posed(above, "middle2", motion.frames["key1"])[0]
    assert np.linalg.norm(found - goal["to"]) < 1.0


def test_bones_that_are_still_stay_at_the_angles_of_their_keys(tmp_path):
    angles = {"MP2_flexion": 40, "PIP2_flexion": 90, "MP2_abduction": 5}
    still = {"touch": [["distal1", "distal2"]], "still": ["middle2"], "angles": angles}
    keys = [{"time": 0, **still}, {"time": 4, **still}]
    motion = expand_motion(written(tmp_path, keys), RIG)
    for frame in motion.frames.values():
        assert {n: frame[n] for n in angles} == pytest.approx({n: np.radians(v) for n, v in angles.items()})
        assert abs(frame["DIP2_flexion"]) + abs(frame["IP1_flexion"]) > 0.1  # the others move


def test_what_is_out_of_reach_is_said_by_key_with_its_distance(tmp_path):
    far = {"bone": "distal2", "at": "tip", "to": [float(c) for c in tips()[2] + [60, 0, 0]]}
    keys = [{"time": 0, "name": "rest"}, {"time": 4, "name": "far", "reach": [far]}]
    motion = expand_motion(written(tmp_path, keys), RIG)
    [said] = motion.said
    assert said.startswith("far: target 1 is out of reach") and "mm are left" in said
    left = distance(motion, "far", "distal2", far["to"])
    assert motion.figures["far"]["target_distance"] == pytest.approx(left, abs=0.5) and left > 30


def test_bones_that_collide_are_pushed_apart():
    check = PoseValidity(RIG)
    clash = ZERO | {"MP2_abduction": np.radians(-20), "MP3_abduction": np.radians(20)}
    assert check.check(clash).collisions
    solver = TargetSolver(RIG, 6.0, check)
    found = solver.near(clash, clash, solver.asked([], {}), solver.limits(clash))
    assert sum(check.check(found.angles).collisions.values()) < 0.4
    assert all(abs(found.angles[n] - clash[n]) < np.radians(25) for n in ZERO)  # and not undone


def test_the_push_has_the_derivatives_of_finite_differences():
    clash = ZERO | {"MP2_abduction": np.radians(-20), "MP3_abduction": np.radians(20), "PIP2_flexion": 0.3}
    contact = PoseValidity(RIG).contacts(clash)[0]
    target = Apart(contact.bone, contact.point, contact.other, contact.closest, contact.normal)
    _, rates = target.residual(moving_bones(RIG, clash))
    h = 1e-6
    for i, name in enumerate(RIG.angle_names):
        up, down = (
            target.residual(moving_bones(RIG, clash | {name: clash[name] + s * h}))[0][0] for s in (1, -1)
        )
        assert rates[0, i] == pytest.approx((up - down) / (2 * h), abs=1e-4)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ([{"time": 0}, {"time": 0}], r"keys\.1 \(key2\), time: is not later than 'key1'"),
        (
            [{"time": 0}, {"time": 1, "touch": [["distal1", "distal9"]]}],
            r"keys\.1 \(key2\): no bone 'distal9'",
        ),
        ([{"time": 0}, {"time": 1, "still": ["distal9"]}], r"keys\.1 \(key2\): no bone 'distal9'"),
        ([{"time": 0}, {"time": 1, "angles": {"PIP2_flexion": 200}}], "PIP2_flexion: 200 deg is outside"),
        ([{"time": 0}, {"time": 1, "angles": {"PIP7_flexion": 2}}], "PIP7_flexion: is not an angle"),
        ([{"time": 0, "name": "a"}, {"time": 1, "name": "a"}], r"keys\.1 \(a\): its name is another key's"),
        ([{"time": 0}], "keys: there are 1 of them"),
        ([{"time": 0}, {"time": 1, "reach": [{"bone": "distal2", "to": [1, 2]}]}], r"keys\.1\.reach\.0\.to"),
    ],
)
def test_wrong_files_are_refused_by_key(tmp_path, keys, message):
    path = written(tmp_path, keys)
    with pytest.raises(InputError, match=message):
        motion_frame_names(path, RIG.limits, RIG.bones)
