"""Random poses are within limits, without colliding bones, and the same for the same seed."""

from dataclasses import replace

import numpy as np
import pytest
from five_fingers import rig

from handpipe.core.errors import InputError
from handpipe.skeleton.joints.joint_tree import FittedPose
from handpipe.skeleton.motion import expand_motion, is_motion, motion_frame_names
from handpipe.skeleton.posing.validity import PoseValidity

RIG = rig()


def written(folder, text):
    path = folder / "random.yaml"
    path.write_text(f"# poses\nrandom: {text}\n")
    return path


def test_poses_are_valid_named_and_repeatable(tmp_path) -> None:
    path = written(tmp_path, "{count: 5, seed: 3}")
    assert is_motion(path)
    found = expand_motion(path, RIG).frames
    assert list(found) == motion_frame_names(path, RIG.limits) == [f"random{i}" for i in range(1, 6)]
    validity = PoseValidity(RIG)
    for pose in found.values():
        RIG.check_limits(pose, "random")
        assert not validity.check(pose).collisions
    assert expand_motion(path, RIG).frames == found
    assert expand_motion(written(tmp_path, "{count: 5, seed: 4}"), RIG).frames != found


def test_a_pose_of_its_own_seed_does_not_depend_on_the_others(tmp_path) -> None:
    few, many = (
        expand_motion(written(tmp_path, f"{{count: {count}, seed: 3, seeds: each}}"), RIG).frames
        for count in (2, 5)
    )
    assert {name: many[name] for name in few} == few
    rng, validity = np.random.default_rng([3, 4]), PoseValidity(RIG)  # of the fifth pose, drawn alone
    lower, upper = np.array([RIG.limits[name] for name in RIG.angle_names]).T
    while validity.check(
        pose := dict(zip(RIG.angle_names, rng.uniform(lower, upper), strict=True))
    ).collisions:
        pass
    assert many["random5"] == pose
    assert expand_motion(written(tmp_path, "{count: 2, seed: 3}"), RIG).frames != few


def test_poses_around_scans_are_their_mixtures(tmp_path) -> None:
    """Two scans, and no spread: every pose is on the line between them."""
    zero = dict.fromkeys(RIG.angle_names, 0.0)
    bent = {n: 0.5 * RIG.limits[n][1] if n.endswith("flexion") else 0.0 for n in RIG.angle_names}
    root = RIG.bone_transforms(zero)["carpals"]
    made = replace(RIG, poses={"flat": FittedPose(root, zero), "bent": FittedPose(root, bent)})
    found = expand_motion(written(tmp_path, "{count: 6, around: scans, spread: 0}"), made).frames
    names = [n for n in RIG.angle_names if bent[n]]
    shares = np.array([[pose[n] / bent[n] for n in names] for pose in found.values()])
    assert shares == pytest.approx(np.tile(shares[:, :1], len(names)))
    assert np.ptp(shares[:, 0]) > 0.2


def test_wrong_files_are_refused(tmp_path) -> None:
    for text, said in (
        ("{count: 0}", "count"),
        ("{count: 3, around: x}", "around"),
        ("{count: 3, seeds: x}", "seeds"),
        ("{}", "count"),
    ):
        with pytest.raises(InputError, match=said):
            expand_motion(written(tmp_path, text), RIG)
