"""Landmarks that an independent formula made give back its angles; wrong files are refused."""

import json

import numpy as np
import pytest
from five_fingers import DESCRIPTION, KNUCKLES, posed, random_angles, rig
from scipy.spatial.transform import Rotation

from handpipe.core.errors import InputError
from handpipe.skeleton.drivers.bone_lines import bone_tips
from handpipe.skeleton.drivers.landmark_motion import landmark_angles, read_landmark_angles
from handpipe.skeleton.drivers.landmarks import LANDMARKS, HandLandmarks, is_landmark_table, read_landmarks

RIG = rig()
TIPS = bone_tips(RIG)
CAMERA = Rotation.from_euler("xyz", [2.0, -0.4, 1.1]).as_matrix()


def seen(angles, scale=0.001, lengths=1.0, residuals=True):
    """The 21 points (21, 3) that a camera sees; `lengths` stretches the fingers beyond their knuckles."""
    place = {d[2]: posed(np.array(d[5]), d[1], angles, residuals)[0] for d in DESCRIPTION}
    knuckles = np.array([*KNUCKLES.values()])
    points = [knuckles.mean(axis=0) - 70.0 * np.array([66.0, 4, 0]) / np.hypot(66, 4)]
    for digit in range(1, 6):
        parts = ("metacarpal", "proximal", "distal") if digit == 1 else ("proximal", "middle", "distal")
        bones = [f"{p}{digit}" for p in parts]
        chain = [place[b] for b in bones] + [posed(TIPS[bones[-1]], bones[-1], angles, residuals)[0]]
        out = [chain[0]]
        for a, b in zip(chain[:-1], chain[1:], strict=True):
            out.append(out[-1] + lengths * (b - a))
        points += out
    return scale * np.array(points) @ CAMERA.T + [0.1, 0.2, 0.5]


def landmarks(frames, hand=None):
    return HandLandmarks(tuple(f"f{i}" for i in range(len(frames))), np.array(frames), hand)


def errors(found, truth):
    return np.degrees([abs(found[n] - truth[n]) for n in truth])


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_angles_are_found_again(seed):
    truth = random_angles(seed, 0.7)
    found = landmark_angles(landmarks([seen(truth, residuals=False)]), rig(residuals=False))["f0"]
    assert errors(found, truth).max() < 0.5
    # Residual motions shift the joints' centres by a millimetre, by which directions differ.
    assert errors(landmark_angles(landmarks([seen(truth)]), RIG)["f0"], truth).mean() < 1


def test_a_hand_of_other_proportions_gives_nearly_the_same_angles():
    truth = random_angles(4, 0.7)
    found = landmark_angles(landmarks([seen(truth, lengths=1.15)]), RIG)["f0"]
    assert errors(found, truth).mean() < 3


def test_noise_of_two_millimetres_costs_a_few_degrees_and_limits_hold():
    rng, truths = np.random.default_rng(0), [random_angles(s, 0.7) for s in (5, 6)]
    noisy = [seen(t) + 0.002 * rng.normal(size=(21, 3)) for t in truths]
    found = landmark_angles(landmarks(noisy), RIG)
    for frame, truth in zip(found.values(), truths, strict=True):
        assert errors(frame, truth).mean() < 8
        assert all(a <= frame[n] <= b for n, (a, b) in RIG.limits.items())


def test_landmarks_of_the_other_hand_are_mirrored():
    truth = random_angles(7, 0.7)
    right = seen(truth)
    left = right * [-1, 1, 1]
    same = landmark_angles(landmarks([right], "right"), RIG)["f0"]
    assert landmark_angles(landmarks([left], "left"), RIG)["f0"] == pytest.approx(same, abs=1e-6)
    mirrored_rig = landmark_angles(landmarks([left], "left"), rig(mirrored=True), hand="left")["f0"]
    assert mirrored_rig == pytest.approx(same, abs=1e-3)


def write_csv(path, frames, unit="m"):
    header = ",".join(["frame", *(f"{n}_{c} [{unit}]" for n in LANDMARKS for c in "xyz")])
    rows = [",".join([f"f{i}", *(repr(float(v)) for v in f.ravel())]) for i, f in enumerate(frames)]
    path.write_text("\n".join([header, *rows]) + "\n")


def test_json_and_csv_say_the_same(tmp_path):
    points = seen(random_angles(1, 0.7))
    write_csv(tmp_path / "a.csv", [points])
    data = {"units": "m", "handedness": "Right", "frames": [points.tolist()]}
    (tmp_path / "a.json").write_text(json.dumps(data))
    as_objects = [[dict(zip("xyz", p, strict=True)) for p in points.tolist()]]
    (tmp_path / "b.json").write_text(json.dumps(data | {"frames": as_objects}))
    table, text, objects = (read_landmarks(tmp_path / n) for n in ("a.csv", "a.json", "b.json"))
    assert np.array_equal(table.points, text.points) and np.array_equal(objects.points, text.points)
    assert is_landmark_table(tmp_path / "a.csv") and text.hand == "right" and table.hand is None
    assert list(read_landmark_angles(tmp_path / "a.json", RIG)) == ["frame1"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("units"), "units: has no unit"),
        (lambda d: d.update(units="image"), r"units: does not say its unit \('image'\)"),
        (lambda d: d.update(handedness="both"), "handedness: is 'both'"),
        (lambda d: d["frames"][0].pop(), r"frames\[0\]: has 20 points"),
        (lambda d: d["frames"][0].__setitem__(4, [0, "x", 1]), r"frames\[0\], THUMB_TIP: .* are not numbers"),
        (lambda d: d["frames"][0].__setitem__(4, [0, float("nan"), 1]), "THUMB_TIP: is not three finite"),
        (lambda d: d.update(frames=[]), "frames: is missing or empty"),
        (lambda d: d["frames"][0].reverse(), "palm's landmarks are .* off"),
        (lambda d: d.update(frames=[[[i, 0, 0] for i in range(21)]]), "too little of a palm"),
    ],
)
def test_wrong_files(tmp_path, change, message):
    data = {"units": "m", "handedness": "Right", "frames": [seen(random_angles(1)).tolist()]}
    change(data)
    (tmp_path / "a.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match=message):
        read_landmark_angles(tmp_path / "a.json", RIG)


def test_wrong_tables(tmp_path):
    write_csv(tmp_path / "a.csv", [seen(random_angles(1))], unit="inch")
    with pytest.raises(InputError, match="does not say its unit"):
        read_landmarks(tmp_path / "a.csv")
    write_csv(tmp_path / "a.csv", [seen(random_angles(1))])
    text = (tmp_path / "a.csv").read_text()
    (tmp_path / "a.csv").write_text(text.replace("PINKY_TIP_z", "PINKY_END_z"))
    with pytest.raises(InputError, match=r"column 64 is not 'PINKY_TIP_z \[m\]'"):
        read_landmarks(tmp_path / "a.csv")


@pytest.mark.parametrize("suffix", ["json", "csv", "semicolons"])
def test_frames_in_which_no_hand_was_found_are_refused_by_name(tmp_path, suffix):
    """A detector writes zeros for a hand that it does not find, and one point for what it hides."""
    good = seen(random_angles(1, 0.7))
    hidden = good.copy()
    hidden[LANDMARKS.index("PINKY_TIP")] = hidden[LANDMARKS.index("PINKY_DIP")]
    for bad, problem in (
        (np.zeros((21, 3)), "all points are 0, 0, 0: no hand was found"),
        (hidden, "PINKY_DIP, PINKY_TIP are at one point"),
    ):
        path = tmp_path / ("hand.JSON" if suffix == "json" else "hand.csv")
        if suffix == "json":
            path.write_text(json.dumps({"units": "m", "frames": [good.tolist(), bad.tolist()]}))
        else:
            write_csv(path, [good, bad])
        if suffix == "semicolons":
            path.write_text(path.read_text().replace(",", ";").replace(".", ","))
            assert is_landmark_table(path)
        with pytest.raises(InputError) as error:
            read_landmarks(path)
        assert problem in error.value.problem
        assert ("frames[1]" if suffix == "json" else "row 3 (frame f1)") in error.value.field
