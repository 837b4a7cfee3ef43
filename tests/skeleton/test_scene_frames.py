"""Whatever a scene's `frames` names becomes the same angles."""

import json

import pytest
from five_fingers import random_angles, rig
from test_bvh import text
from test_landmarks import seen, write_csv

from handpipe.core.errors import InputError
from handpipe.skeleton.drivers.scene_frames import frame_names, read_frames
from handpipe.skeleton.joints.angles import write_angles

RIG = rig(residuals=False)
TRUTH = random_angles(1, 0.7)


def test_four_kinds_of_files_drive_the_rig(tmp_path):
    paths = [tmp_path / n for n in ("angles.csv", "motion.bvh", "hand.json", "hand.csv")]
    write_angles(paths[0], {"a": TRUTH})
    paths[1].write_text(text([TRUTH]))
    points = seen(TRUTH)
    paths[2].write_text(json.dumps({"units": "m", "frames": [points.tolist()]}))
    write_csv(paths[3], [points])
    for path, name in zip(paths, ("a", "frame1", "frame1", "f0"), strict=True):
        assert frame_names(path, RIG.limits) == [name]
        assert read_frames(path, rig())[name] == pytest.approx(TRUTH, abs=0.06)


def test_angles_beyond_limits_are_refused_before_a_rig_is_there(tmp_path):
    write_angles(tmp_path / "a.csv", {"a": TRUTH | {"PIP2_flexion": 3.0}})
    with pytest.raises(InputError, match="outside its limits"):
        frame_names(tmp_path / "a.csv", RIG.limits)
    with pytest.raises(InputError, match="does not exist"):
        frame_names(tmp_path / "b.csv", RIG.limits)


def test_a_scene_without_frames_and_unknown_joints_are_refused_before_a_rig_is_there(tmp_path):
    header = ["frame", *(f"{n} [deg]" for n in RIG.angle_names)]
    for content in ("", ",".join(header), ";".join(header) + "\n\n"):
        (tmp_path / "empty.csv").write_text(content)
        with pytest.raises(InputError, match="rows: there are none|header: does not begin"):
            frame_names(tmp_path / "empty.csv", RIG.limits)
    with pytest.raises(InputError, match="cannot be read"):
        frame_names(tmp_path, RIG.limits)
    (tmp_path / "motion.bvh").write_text(text([TRUTH]))
    bones = list(RIG.bones)
    assert frame_names(tmp_path / "motion.bvh", RIG.limits, bones, {}) == ["frame1"]
    with pytest.raises(InputError, match="thumb: is not a joint of this file"):
        frame_names(tmp_path / "motion.bvh", RIG.limits, bones, {"proximal1": "thumb"})
    with pytest.raises(InputError, match="none is named as a bone"):
        frame_names(tmp_path / "motion.bvh", RIG.limits, ["a", "b"], {})
