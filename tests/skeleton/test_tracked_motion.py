"""Manufactured tracks of known angles come back through noise, jumps and gaps; so do real recordings."""

from pathlib import Path

import numpy as np
import pytest
from five_fingers import random_angles, rig
from test_landmarks import CAMERA, seen

from handpipe.core.configuration import Recording
from handpipe.core.errors import InputError
from handpipe.skeleton.joints.limits import long_axis
from handpipe.skeleton.motion import expand_motion, motion_frame_names
from handpipe.skeleton.motion.tracked_motion import without_outliers
from handpipe.skeleton.motion.tracks import POINTS, read_track

RIG = rig(residuals=False)
REAL = Path(__file__).parents[3] / "shared" / "data" / "leap_motion"
A, B = random_angles(1, 0.6), random_angles(2, 0.6)
STEP = 0.02  # s, of the manufactured recording
NAMES = list(RIG.angle_names)


def truth(time):
    """A slow swing between two poses."""
    share = 0.5 - 0.5 * np.cos(2 * np.pi * 0.4 * time)
    return {n: (1 - share) * A[n] + share * B[n] for n in A}


def written(path, times, noise=0.0, side="right", spoil=None, confidence=None):
    rng = np.random.default_rng(0)
    points = [f"{p}_{c}" for p in POINTS for c in "xyz"]
    lines = [",".join(["frame", "timestamp_us", "side", "hand_id", "confidence", *points])]
    for i, time in enumerate(times):
        points = seen(truth(time), scale=1.0, residuals=False)[1:] + noise * rng.normal(size=(20, 3))
        points = points if side == "right" else points * [-1, 1, 1]
        if spoil is not None:
            points = spoil(i, points)
        sure = 0.9 if confidence is None else confidence(i)
        cells = [i, round(1e6 * (7 + time)), side, 3, sure, *(f"{v:.4f}" for v in points.ravel())]
        lines.append(",".join(map(str, cells)))
    path.write_text("\n".join(lines) + "\n")
    return path


def with_palm(path):
    """The same recording with the palm's direction, that of the rig's own bone of the middle knuckle."""
    along = long_axis(RIG.surfaces["carpals"])
    along = CAMERA @ (along * np.sign(along[0]))
    header, *lines = path.read_text().splitlines()
    cells = ",".join(f"{v:.6f}" for v in along)
    columns = ",".join(f"palm_direction_{c}" for c in "xyz")
    path.write_text("\n".join([f"{header},{columns}", *(f"{line},{cells}" for line in lines)]) + "\n")
    return path


def errors(motion, start=0.0, rate=24.0):
    """Differences (frames, angles) in degrees; the number in a frame's name gives its time."""
    rows = []
    for name, angles in motion.frames.items():
        known = truth(start + (int(name.removeprefix("frame")) - 1) / rate)
        rows.append([np.degrees(angles[n] - known[n]) for n in NAMES])
    return np.array(rows)


TIMES = np.arange(0, 1.2, STEP)


def test_known_angles_come_back_at_the_scenes_own_rate(tmp_path):
    path = written(tmp_path / "a.csv", TIMES)
    motion = expand_motion(path, RIG, recording=Recording(smooth=0.0))
    assert list(motion.frames) == motion_frame_names(path, RIG.limits, recording=Recording())
    assert len(motion.frames) == 29  # 1.18 s at 24 a second
    assert np.abs(errors(motion)).max() < 1.0
    assert max(f["tracking_residual"] for f in motion.figures.values()) < 0.3


def test_the_palms_direction_stands_in_for_a_thumb_that_is_tracked_elsewhere(tmp_path):
    def spoil(i, points):  # the tracker has the thumb's first joint 12 mm farther out
        return points + np.outer(np.arange(20) == 0, CAMERA @ np.array([0.0, 12, 0]))

    path = written(tmp_path / "a.csv", TIMES[:10], spoil=spoil)
    fingers = [i for i, n in enumerate(NAMES) if n.startswith("MP") and n.endswith("abduction")]
    without = errors(expand_motion(path, RIG, recording=Recording(smooth=0.0)))
    known = errors(expand_motion(with_palm(path), RIG, recording=Recording(smooth=0.0)))
    assert np.abs(known[:, fingers]).mean() < 0.6 * np.abs(without[:, fingers]).mean()


def test_the_filter_takes_noise_and_leaves_the_motion(tmp_path):
    path = written(tmp_path / "a.csv", TIMES, noise=1.5)
    rough = errors(expand_motion(path, RIG, recording=Recording(smooth=0.0)))
    smooth = errors(expand_motion(path, RIG, recording=Recording(smooth=0.06)))
    assert np.sqrt((smooth**2).mean()) < 0.65 * np.sqrt((rough**2).mean())
    assert np.sqrt((smooth[3:-3] ** 2).mean()) < 3.0


def test_a_jump_of_two_rows_is_taken_out_and_said(tmp_path):
    moved = (np.arange(20) >= 4) & (np.arange(20) % 4 > 0)  # the fingers without their knuckles

    def spoil(i, points):
        return points + 70.0 * np.outer(moved & (i in (30, 31)), [0, 0, 1])

    path = written(tmp_path / "a.csv", TIMES, spoil=spoil)
    motion = expand_motion(path, RIG, recording=Recording(smooth=0.0))
    assert any("outlier" in said for said in motion.said)
    assert np.abs(errors(motion)).max() < 10.0  # the jump bends fingers by tens of degrees


def test_short_gaps_are_bridged_and_long_ones_have_no_frames(tmp_path):
    there = (TIMES < 0.3) | (TIMES > 0.42)
    path = written(tmp_path / "a.csv", TIMES[there])
    bridged = expand_motion(path, RIG, recording=Recording(smooth=0.0, bridge=0.2))
    assert len(bridged.frames) == 29 and np.abs(errors(bridged)).max() < 2.0
    marked = [name for name, figures in bridged.figures.items() if figures["bridged"]]
    assert marked == ["frame8", "frame9", "frame10", "frame11"]
    assert any("gap from 0.28 to 0.44 s: bridged" in said for said in bridged.said)
    cut = expand_motion(path, RIG, recording=Recording(smooth=0.0, bridge=0.1))
    assert [n for n in bridged.frames if n not in cut.frames] == ["frame8", "frame9", "frame10", "frame11"]
    assert any("longer than is bridged" in said for said in cut.said)


def test_rows_of_little_confidence_count_as_missing(tmp_path):
    path = written(tmp_path / "a.csv", TIMES, confidence=lambda i: 0.1 if 20 <= i < 24 else 0.9)
    assert read_track(path, "right").unsure == 4 and len(read_track(path, "right").times) == len(TIMES) - 4


def test_the_other_hand_is_mirrored(tmp_path):
    short = TIMES[:12]
    right = expand_motion(written(tmp_path / "r.csv", short), RIG, recording=Recording())
    left = expand_motion(
        written(tmp_path / "l.csv", short, side="left"), RIG, recording=Recording(side="left")
    )
    for a, b in zip(right.frames.values(), left.frames.values(), strict=True):
        assert a == pytest.approx(b, abs=1e-3)
    with pytest.raises(InputError, match="0 rows of a right hand.*Name the other hand"):
        motion_frame_names(tmp_path / "l.csv", RIG.limits)


def test_limits_hold_beyond_what_is_tracked(tmp_path):
    path = written(tmp_path / "a.csv", TIMES[:15], noise=4.0)
    for angles in expand_motion(path, RIG, recording=Recording(smooth=0.02)).frames.values():
        assert all(low <= angles[n] <= high for n, (low, high) in RIG.limits.items())


def test_an_outlier_is_replaced_and_a_fast_motion_kept():
    times = np.arange(40) * STEP
    ramp = np.column_stack([np.radians(4.0) * np.arange(40), np.zeros(40)])
    spoilt = ramp.copy()
    spoilt[17, 1] = 1.0
    found, count = without_outliers(times, spoilt)
    assert count == 1 and found == pytest.approx(ramp)


@pytest.mark.parametrize(
    ("change", "recording", "message"),
    [
        (lambda t: t.replace("ring_tip_z", "ring_end_z"), {}, "header: there is no column 'ring_tip_z'"),
        (lambda t: t.replace("7040000", "7000000"), {}, "row 4, timestamp_us: is not later"),
        (lambda t: t.replace("7040000", "late"), {}, "row 4: 'late' is not a number"),
        (
            lambda t: t,
            {"count": 99},
            "asks for 99 frames, but the recording has 7 of its right hand",
        ),
        (lambda t: t, {"start": 50.0}, "recording: asks for 0 frames"),
    ],
)
def test_wrong_recordings_are_refused(tmp_path, change, recording, message):
    path = written(tmp_path / "a.csv", TIMES[:14])
    path.write_text(change(path.read_text()))
    with pytest.raises(InputError, match=message):
        motion_frame_names(path, RIG.limits, recording=Recording(**recording))


@pytest.mark.skipif(not REAL.is_dir(), reason="the shared recordings are not beside the checkout")
@pytest.mark.parametrize(
    ("name", "side", "start"),
    [("gun", "right", 0.2), ("grab", "right", 0.5), ("confidence-37fps", "left", 5)],
)
def test_real_recordings_are_followed_within_limits(name, side, start):
    path = next(REAL.glob(f"{name}*.csv"))
    motion = expand_motion(path, RIG, recording=Recording(side=side, start=start, count=6))
    assert len(motion.frames) == 6
    rms = np.sqrt(np.mean([f["tracking_residual"] ** 2 for f in motion.figures.values()]))
    assert rms < 16.0  # mm, of a rig of other proportions
    steps = np.abs(np.diff([[a[n] for n in NAMES] for a in motion.frames.values()], axis=0))
    assert np.degrees(steps).max() < 40
    for angles in motion.frames.values():
        assert all(low <= angles[n] <= high for n, (low, high) in RIG.limits.items())


@pytest.mark.skipif(not REAL.is_dir(), reason="the shared recordings are not beside the checkout")
def test_a_real_hand_that_goes_and_comes_back_has_no_frames_between():
    path = REAL / "confidence-37fps.csv"
    track = read_track(path, "right")
    long = track.gaps(0.25)
    assert len(long) == 2
    found = motion_frame_names(path, RIG.limits, recording=Recording(side="right"))
    every = motion_frame_names(path, RIG.limits, recording=Recording(side="right", bridge=5.0))
    times = np.arange(len(every)) / 24
    lost = sum(int(np.sum((times > a) & (times < b))) for a, b in long)
    assert len(every) - len(found) == lost > 20
