"""The shipped motions on the phantom hand's rig: their frames, limits, collisions, and what poses show."""

from pathlib import Path

import numpy as np
import pytest

from handpipe.core.configuration import load_scene
from handpipe.core.configuration.dataset import load_dataset
from handpipe.hand import joint_limits
from handpipe.mesh.surfaces import Distance
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.drivers.bone_lines import bone_tips
from handpipe.skeleton.motion import expand_motion, is_motion, motion_frame_names
from handpipe.skeleton.posing.collisions import collisions_of
from handpipe.skeleton.posing.validity import PoseValidity
from handpipe.skeleton.rig.rig import Rig
from handpipe.synthetic.phantom.phantom_hand import posture
from handpipe.synthetic.phantom.phantom_hand_bones import bones

ROOT = Path(__file__).parents[2]
DATA = load_dataset(ROOT / "config/datasets/phantom-hand-preview.yaml")
FRAMES = {
    "close-fist": 132,
    "thumb-opposition": 996,
    "numbers": 360,
    "sign-letters": 732,
}  # Zheng 2022, Table 3
EVERY = 4  # frames; every so many are looked at for collisions, as are all keys
MEETING = ("close-fist", "thumb-opposition")  # motions of inverse kinematics
BEHIND = ("proximal2", "middle2", "distal2", "middle3", "distal3")  # bones that the fist's thumb is before
FINGERS = {"index": 2, "middle": 3, "ring": 4, "little": 5}


@pytest.fixture(scope="module")
def rig():
    """A rig of the phantom's true motions in the preview's examples, known as well as scans tell."""
    surfaces = {name: Surface(*b.surface(b.known.whole, 1.5)) for name, b in bones().items()}
    poses = ["neutral", *DATA.examples]
    covariance = np.diag([np.radians(0.1) ** 2] * 3 + [0.01**2] * 3)
    seen = {
        pose: {b: Registration(t, 0.03, covariance) for b, t in posture(pose, 1).transforms().items()}
        for pose in poses
    }
    moved = {pose: {b: r.transform for b, r in found.items()} for pose, found in seen.items()}
    return Rig.fit(DATA, moved, surfaces, poses, seen)


@pytest.fixture(scope="module")
def motions(rig):
    return {name: expand_motion(ROOT / frames_of(name), rig) for name in FRAMES}


def frames_of(name):
    return load_scene(ROOT / f"config/scenes/{name}.yaml").frames


@pytest.mark.parametrize("name", FRAMES)
def test_frames_are_as_many_as_in_the_paper_and_within_limits(name, motions, rig):
    path = ROOT / frames_of(name)
    names = motion_frame_names(path, joint_limits(DATA), tuple(DATA.bones))
    assert is_motion(path) and len(names) == FRAMES[name]
    assert list(motions[name].frames) == names
    for angles in motions[name].frames.values():
        assert all(low <= angles[n] <= high for n, (low, high) in rig.limits.items())


@pytest.mark.parametrize("name", FRAMES)
def test_bones_do_not_collide_and_joints_do_not_jump(name, motions, rig):
    frames = motions[name].frames
    looked = {f: angles for i, (f, angles) in enumerate(frames.items()) if i % EVERY == 0 or "+" not in f}
    assert [str(found) for found in collisions_of(PoseValidity(rig), looked)] == []
    values = np.degrees([list(a.values()) for a in frames.values()])
    assert np.abs(np.diff(values, axis=0)).max() < (3.0 if name in MEETING else 7.0)  # degrees


def extended(rig, angles):
    """Fingers whose tip is farther from the wrist than their middle joint."""
    moved, tips = rig.bone_transforms(angles), bone_tips(rig)
    joints = {j.child: j for j in rig.joints}
    found = set()
    for finger, digit in FINGERS.items():
        place = joints[f"middle{digit}"]
        knuckle = moved[place.parent](place.fit.centre)[0]
        if moved[f"distal{digit}"](tips[f"distal{digit}"])[0] > knuckle + 20:
            found.add(finger)
    return found


SHAPES = {
    "numbers": {
        "one": {"index"},
        "two": {"index", "middle"},
        "three": {"index", "middle"},
        "four": set(FINGERS),
        "five": set(FINGERS),
    },
    "sign-letters": {
        "A": set(), "B": set(FINGERS), "D": {"index"}, "E": set(), "F": {"middle", "ring", "little"},
        "I": {"little"}, "L": {"index"}, "O": set(), "S": set(), "U": {"index", "middle"},
        "V": {"index", "middle"}, "W": {"index", "middle", "ring"}, "X": set(), "Y": {"little"},
    },
    "close-fist": {"open": set(FINGERS), "fist": set()},
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_numbers_and_letters_stretch_the_fingers_that_they_need(name, motions, rig):
    found = {key: extended(rig, motions[name].frames[key]) for key in SHAPES[name]}
    assert found == SHAPES[name]


def test_thumbs_lie_where_letters_have_them(motions, rig):
    """Radial of the index: A, L, Y. Across the palm: B, S, W. The pads of D, F and O touch."""
    tips, frames = bone_tips(rig), motions["sign-letters"].frames

    def places(letter):
        moved = rig.bone_transforms(frames[letter])
        return {d: moved[f"distal{d}"](tips[f"distal{d}"]) for d in range(1, 6)} | {
            "knuckle": moved["proximal2"](next(j.fit.centre for j in rig.joints if j.child == "proximal2"))
        }

    for letter in "ALY":
        assert places(letter)[1][1] > places(letter)["knuckle"][1] + 5
    for letter in "BSW":
        assert places(letter)[1][1] < places(letter)["knuckle"][1]
    for letter, finger in (("D", 3), ("F", 2), ("O", 2)):
        assert np.linalg.norm(places(letter)[1] - places(letter)[finger]) < 30


def test_the_thumb_meets_every_finger(motions):
    motion = motions["thumb-opposition"]
    for finger in FINGERS:
        assert motion.figures[finger]["target_distance"] < 1.0
        assert motion.figures[f"{finger}+15"]["target_distance"] < 4.0  # bones are kept apart first


def test_the_thumb_of_the_fist_lies_on_the_back_of_the_index_finger(motions, rig):
    """Dorsal of its middle phalanx, with room for skin: at most 8 mm away, and 2 mm from all others."""
    motion = motions["close-fist"]
    for frame in ("fist", "closed"):
        assert motion.figures[frame]["target_distance"] < 1.0
        moved = rig.bone_transforms(motion.frames[frame])
        thumb = moved["distal1"](rig.surfaces["distal1"].vertices)
        gaps = {b: Distance(rig.surfaces[b].moved(moved[b](rig.surfaces[b].vertices))) for b in BEHIND}
        gaps = {b: d.closest(thumb)[0].min() for b, d in gaps.items()}
        assert 4.0 < gaps["middle2"] < 8.0 and min(gaps.values()) > 2.0
        nearest = moved["middle2"].inverse()(thumb).mean(axis=0) - rig.surfaces["middle2"].vertices.mean(
            axis=0
        )
        assert nearest[2] > 5.0  # mm dorsal, in the neutral frame


def test_the_performance_plays_as_many_frames_as_the_papers():
    scene = load_scene(ROOT / "config/scenes/performance.yaml")
    path = ROOT.parent / scene.frames.relative_to("..")
    if not path.exists():
        pytest.skip("the shared recordings are not beside the checkout")
    assert len(motion_frame_names(path, joint_limits(DATA), recording=scene.recording)) == 653
