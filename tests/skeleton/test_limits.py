"""Limits hold what was seen and what is published; zero is where the bones say."""

import numpy as np
import pytest
from five_fingers import DESCRIPTION, rig

from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.limits import long_axis, neutral_bend, reference_range, widened_limits

ZERO = {n: 0.0 for d in DESCRIPTION for n in d[3]}


def test_published_ranges_by_name():
    assert np.degrees(reference_range("PIP4_flexion")) == pytest.approx([0, 100])
    assert reference_range("MCP5_abduction") == reference_range("MP5_abduction")
    assert np.degrees(reference_range("TM_abduction")) == pytest.approx([-30, 50])
    assert np.degrees(reference_range("MP1_flexion")) == pytest.approx([-10, 50])
    for unknown in ("MP1_abduction", "CMC5_flexion", "wrist", "CMC4_flexion"):
        assert reference_range(unknown) is None


def test_what_was_seen_widens_and_is_never_cut():
    hyperextended = ZERO | {
        "PIP2_flexion": np.radians(-12),
        "MP3_flexion": np.radians(40),
        "MP1_flexion": 1.2,
    }
    limits = widened_limits(rig(residuals=False, poses=[hyperextended]))
    assert np.degrees(limits["PIP2_flexion"]) == pytest.approx([-15, 100], abs=3)
    assert np.degrees(limits["MP3_flexion"]) == pytest.approx([-30, 90], abs=3)
    assert np.degrees(limits["MP1_flexion"][1]) == pytest.approx(np.degrees(1.2) + 3)


def test_a_bend_in_neutral_moves_the_published_zero():
    plain = rig(residuals=False)
    joint = next(j for j in plain.joints if j.name == "PIP3")
    straight = neutral_bend(plain, joint, 0)
    assert abs(np.degrees(straight)) < 3
    bent = dict(plain.surfaces)
    fold = plain.bone_transforms(ZERO | {"PIP3_flexion": np.radians(25)})
    for bone in ("middle3", "distal3"):
        surface = plain.surfaces[bone]
        bent[bone] = Surface(fold[bone](surface.vertices), surface.triangles)
    folded = type(plain)(plain.root, plain.joints, bent, {})
    assert np.degrees(neutral_bend(folded, joint, 0) - straight) == pytest.approx(25, abs=0.01)
    upper = widened_limits(folded)["PIP3_flexion"][1]
    assert np.degrees(upper) == pytest.approx(75 - np.degrees(straight), abs=0.1)


def test_a_round_bone_has_no_long_axis():
    theta, phi = np.meshgrid(np.linspace(0.1, 3, 20), np.linspace(0, 6, 20))
    ball = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1).reshape(
        -1, 3
    )
    assert long_axis(Surface(ball, np.array([[0, 1, 2]]))) is None
    along = long_axis(Surface(ball * [5, 1, 1], np.array([[0, 1, 2]])))
    assert abs(along[0]) == pytest.approx(1, abs=1e-2)


def test_a_mirrored_hand_has_the_same_limits():
    poses = [ZERO | {"PIP2_flexion": 0.3, "MP4_abduction": -0.5}]
    right, left = (widened_limits(rig(False, mirrored, poses)) for mirrored in (False, True))
    assert left == {n: pytest.approx(p, abs=1e-6) for n, p in right.items()}
