"""Poses inside and outside what was seen; depths of bones against spheres, whose depth is known."""

import numpy as np
import pytest
import trimesh
from five_fingers import DESCRIPTION, random_angles, rig

from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.posing.collisions import collisions_of
from handpipe.skeleton.posing.validity import PoseValidity, validity_table
from handpipe.skeleton.rig.rig import Rig

ZERO = {n: 0.0 for d in DESCRIPTION for n in d[3]}
POSES = [random_angles(s, 0.6) for s in range(5)]
CHECK = PoseValidity(rig(poses=POSES))


def test_seen_poses_are_inside():
    for pose in POSES:
        found = CHECK.check(pose)
        assert found.inside and found.distance == 0
    assert CHECK.check(ZERO).nearest == "neutral"


def test_an_angle_beyond_is_named_by_how_much():
    top = max([p["PIP3_flexion"] for p in POSES] + [0.0])
    low = min([p["MP2_flexion"] for p in POSES] + [0.0])
    found = CHECK.check(POSES[0] | {"PIP3_flexion": top + 0.2, "MP2_flexion": low - 0.1})
    assert found.beyond == {
        "PIP3_flexion": pytest.approx(0.2),
        "MP2_flexion": pytest.approx(-0.1),
    }
    assert not found.inside and "PIP3_flexion +11.5 deg beyond" in str(found)


def test_a_pose_in_every_range_may_still_be_far_from_all():
    """Only fists, open to closed, were seen; every other finger closed alone is in each joint's range."""
    fist = {n: 1.0 if n.endswith("flexion") else 0.0 for n in ZERO}
    fists = [{n: s * a for n, a in fist.items()} for s in (0.2, 0.4, 0.6, 0.8, 1.0)]
    check = PoseValidity(rig(poses=fists))
    other = {n: a * ("2" in n or "4" in n) for n, a in fist.items()}
    found = check.check(other)
    assert not found.beyond
    expected = min(np.sqrt(np.mean([(p[n] - other[n]) ** 2 for n in other])) for p in [ZERO, *fists])
    assert found.distance == pytest.approx(expected)
    assert not found.inside and found.distance > 2 * found.spacing
    assert check.check({n: 0.5 * a for n, a in fist.items()}).inside


def spheres(radius=6.0):
    """The rig with spheres for the tips of index and middle finger, clear of all else."""
    plain = rig(residuals=False)
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    surfaces = {b: Surface(s.vertices * 1e-3 - [0, 0, 900], s.triangles) for b, s in plain.surfaces.items()}
    for i, bone in enumerate(plain.bones):  # nothing but the two touches anything
        surfaces[bone] = Surface(surfaces[bone].vertices + [50.0 * i, 0, 0], surfaces[bone].triangles)
    for bone, y in (("distal2", 10.0), ("distal3", -10.0)):
        surfaces[bone] = Surface(np.array(ball.vertices) + [140, y, 0], np.array(ball.faces))
    return Rig(plain.root, plain.joints, surfaces, {})


def test_the_depth_of_spheres():
    balls = spheres()
    check = PoseValidity(balls)
    assert check.check(ZERO).collisions == {}
    depths = []
    for degrees in (4, 8, 12):
        angles = ZERO | {"MP2_abduction": np.radians(-degrees)}
        transforms = balls.bone_transforms(angles)
        apart = np.linalg.norm(transforms["distal2"](np.array([140.0, 10, 0])) - [140, -10, 0])
        found = check.check(angles).collisions
        expected = max(12.0 - apart, 0.0)
        depths.append(expected)
        assert found.get(("distal2", "distal3"), 0.0) == pytest.approx(expected, abs=0.15)
    assert depths[0] == 0 and depths[2] > 2


def test_a_motion_names_the_frames_in_which_bones_pass_through_one_another():
    """The index finger swings through the middle one, back, and into it again."""
    balls = spheres()
    swing = [0, -8, -12, -8, 0, -12]  # degrees; the tips clear one another at 0
    frames = {f"f{i}": ZERO | {"MP2_abduction": np.radians(a)} for i, a in enumerate(swing)}
    first, second = collisions_of(PoseValidity(balls), frames)
    assert (first.bones, first.first, first.last) == (("distal2", "distal3"), "f1", "f3")
    assert (second.first, second.last) == ("f5", "f5")
    apart = balls.bone_transforms(frames["f2"])["distal2"](np.array([140.0, 10, 0])) - [140, -10, 0]
    assert first.depth == second.depth == pytest.approx(12 - np.linalg.norm(apart), abs=0.15)
    assert "f1 to f3: distal2 and distal3" in str(first) and str(second).startswith("f5: distal2")
    assert collisions_of(PoseValidity(balls), {"open": ZERO}) == []


def test_what_neutral_has_does_not_count():
    deep = spheres(radius=11.0)  # 2 mm in one another in neutral, as touching heads may be segmented
    check = PoseValidity(deep)
    assert check.check(ZERO).collisions == {}
    closer = check.check(ZERO | {"MP2_abduction": np.radians(-3)})
    assert closer.collisions[("distal2", "distal3")] > 1 and not closer.valid


def test_the_table_has_a_row_a_frame():
    rows, metrics = validity_table(CHECK, {"seen": POSES[1], "beyond": dict.fromkeys(ZERO, 3.0)})
    assert [r["frame"] for r in rows] == ["seen", "beyond"]
    assert rows[0]["beyond"] == 0 and rows[0]["nearest"] == "pose1" and rows[1]["beyond"] > 90
    assert metrics["frames_unseen"] == (1.0, "frames")


def test_a_mirrored_hand_is_judged_alike():
    left = PoseValidity(rig(mirrored=True, poses=POSES))
    for seed in (11, 12):
        angles = random_angles(seed, 1.0)
        a, b = CHECK.check(angles), left.check(angles)
        assert a.nearest == b.nearest and a.beyond == b.beyond
        assert set(a.collisions) == set(b.collisions)
        for pair, depth in a.collisions.items():
            assert b.collisions[pair] == pytest.approx(depth, abs=1e-3)
