"""Keyframes become frames at their times and stay between their keys; wrong files are refused."""

from dataclasses import replace

import numpy as np
import pytest
from five_fingers import rig

from handpipe.core.configuration import Recording
from handpipe.core.errors import InputError
from handpipe.core.rigid import RigidTransform
from handpipe.skeleton.drivers import read_frames, write_angles
from handpipe.skeleton.joints.joint_tree import FittedPose
from handpipe.skeleton.motion import expand_motion, is_motion, motion_frame_names
from handpipe.skeleton.motion.interpolation import spline

RIG = rig()
TABLE = """key,time [frame],PIP2_flexion [deg],MP2_flexion [deg]
open,10,0,-5
half,20,60,
fist,41.5,100,80
"""


def written(folder, text, name="keys.csv"):
    path = folder / name
    path.write_text(text)
    return path


def test_a_key_has_its_angles_at_its_time_and_names_the_frames_after_it(tmp_path):
    path = written(tmp_path, TABLE)
    assert is_motion(path)
    motion = expand_motion(path, RIG)
    names = list(motion.frames)
    assert names == motion_frame_names(path, RIG.limits) and len(names) == 32
    assert names[:2] == ["open", "open+1"] and names[10:12] == ["half", "half+1"] and names[-1] == "half+21"
    degrees = {n: np.degrees(motion.frames[n]["PIP2_flexion"]) for n in names}
    assert degrees["open"] == pytest.approx(0) and degrees["half"] == pytest.approx(60)
    assert 97 < degrees["half+21"] < 100  # half a frame before the last key
    assert np.all(np.diff(list(degrees.values())) > 0)
    assert motion.frames["half"]["DIP2_flexion"] == 0.0  # an angle without a column


def test_an_angle_passes_by_a_key_that_does_not_give_it(tmp_path):
    bends = [a["MP2_flexion"] for a in expand_motion(written(tmp_path, TABLE), RIG).frames.values()]
    assert np.degrees(bends[0]) == pytest.approx(-5)
    # Two keys alone: the monotone cubic between them is a straight line, whatever the third key's time.
    assert np.degrees(bends) == pytest.approx(-5 + 85 * np.arange(32) / 31.5)


def test_a_key_takes_the_angles_of_a_scanned_pose_but_for_those_that_it_gives(tmp_path):
    angles = dict.fromkeys(RIG.angle_names, 0.0) | {"PIP2_flexion": 0.5, "MP2_flexion": 0.3}
    known = replace(RIG, poses=RIG.poses | {"hook": FittedPose(RigidTransform.identity(), angles)})
    text = "key,time [frame],pose,MP2_flexion [deg]\na,0,,0\nb,4,hook,\nc,8,hook,10\n"
    path = written(tmp_path, text)
    assert len(motion_frame_names(path, RIG.limits)) == 9  # the plan of a build knows no rig
    found = expand_motion(path, known).frames
    assert found["a"]["PIP2_flexion"] == pytest.approx(0.5)  # passed by: no key gives it before
    assert (found["b"]["PIP2_flexion"], found["b"]["MP2_flexion"]) == pytest.approx((0.5, 0.3))
    assert (found["c"]["PIP2_flexion"], found["c"]["MP2_flexion"]) == pytest.approx((0.5, np.radians(10)))
    with pytest.raises(InputError, match=r"row 3 \(key b\), pose: 'hook' is no pose that the rig explains"):
        expand_motion(path, replace(RIG, poses={}))


def test_seconds_are_twenty_four_frames(tmp_path):
    text = "key;time [s];PIP2_flexion [deg]\na;0;0\nb;5,5;90\n"
    assert len(motion_frame_names(written(tmp_path, text), RIG.limits)) == 133


@pytest.mark.parametrize("seed", range(30))
def test_between_two_keys_a_spline_stays_between_their_values(seed):
    rng = np.random.default_rng(seed)
    values = rng.uniform(-1, 2, rng.integers(2, 9))
    times = np.cumsum(rng.uniform(0.01, 30, len(values)))
    for k in range(len(times) - 1):
        found = spline(times, values, np.linspace(times[k], times[k + 1], 50))
        low, high = sorted(values[k : k + 2])
        assert (found >= low - 1e-9).all() and (found <= high + 1e-9).all()


def test_velocity_has_no_jump_at_a_key():
    times, values = np.array([0.0, 3, 7, 12]), np.array([0.0, 1.0, 4.0, 5.0])
    h = 1e-5
    for key in (3.0, 7.0):
        before, at, after = spline(times, values, np.array([key - h, key, key + h]))
        assert (at - before) / h == pytest.approx((after - at) / h, abs=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("PIP2_flexion", "PIP7_flexion"), r"column 'PIP7_flexion \[deg\]': is not an angle of this rig"),
        (("PIP2_flexion [deg]", "PIP2_flexion"), "column 'PIP2_flexion': does not say its unit"),
        (("MP2_flexion", "PIP2_flexion"), "stands twice"),
        (("half,20", "half,10"), r"row 3 \(key half\), time: is not later than 'open' before it"),
        (("100", "111"), r"row 4 \(key fist\), PIP2_flexion: 111 deg is outside its limits of -5 to 110 deg"),
        (("60", "sixty"), r"row 3 \(key half\), PIP2_flexion: 'sixty' is not a number"),
        (("41.5", "nan"), r"row 4 \(key fist\), time: is not a finite number"),
        (("half", "open"), "row 3, frame: 'open' names another frame already"),
        (("time [frame]", "time [min]"), "header: its second column is not one of"),
        (("60,", "60"), r"row 3 \(key half\): has 3 cells, not 4"),
        (("half,20,60,\nfist,41.5,100,80\n", ""), "keys: there are 1 of them"),
    ],
)
def test_wrong_tables_are_refused_by_row_and_column(tmp_path, change, message):
    path = written(tmp_path, TABLE.replace(*change))
    with pytest.raises(InputError, match=message):
        motion_frame_names(path, RIG.limits)


def test_expanded_angles_are_read_again_as_frames(tmp_path):
    motion = expand_motion(written(tmp_path, TABLE.replace("half", '"a, half"')), RIG)
    write_angles(tmp_path / "angles.csv", motion.frames)
    again = read_frames(tmp_path / "angles.csv", RIG)
    assert list(again) == list(motion.frames)
    assert again["a, half+3"] == pytest.approx(motion.frames["a, half+3"], abs=1e-12)


def test_a_table_of_angles_is_no_motion(tmp_path):
    path = written(tmp_path, "frame,PIP2_flexion [deg]\na,3\n")
    assert not is_motion(path)
    with pytest.raises(InputError, match="holds no keyframes, targets, contractions or tracked points"):
        expand_motion(path, RIG)


def test_keyframes_with_the_settings_of_a_recording_are_refused(tmp_path):
    path, recording = written(tmp_path, TABLE), Recording.model_validate({"rate": 30})
    for read in (
        lambda: motion_frame_names(path, RIG.limits, recording=recording),
        lambda: expand_motion(path, RIG, recording=recording),
    ):
        with pytest.raises(InputError, match="recording: is given, but .* holds no tracked points"):
            read()
