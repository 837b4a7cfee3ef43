"""BVH files written from an independent formula give back its angles; wrong files are refused by line."""

from dataclasses import replace

import numpy as np
import pytest
from five_fingers import DESCRIPTION, posed, random_angles, rig, tips
from scipy.spatial.transform import Rotation

from handpipe.core.errors import InputError
from handpipe.skeleton.drivers.bvh import read_bvh, write_bvh
from handpipe.skeleton.drivers.bvh_motion import bvh_frame_names, bvh_of, least_rotation, read_bvh_angles

RIG = rig()
MIRROR = np.diag([1.0, -1.0, 1.0])
POSES = [random_angles(s, 0.7) for s in (1, 2)]


def text(poses, frame=None, scale=1.0, order="ZXY", rename=None, mirror=None):
    """A BVH file of the formula's poses, in a frame of its own, as an exporter would write it."""
    frame = np.eye(3) if frame is None else frame
    mirror = np.eye(3) if mirror is None else mirror
    rename = rename or (lambda b: b)
    centre = {"carpals": np.zeros(3)} | {d[2]: np.array(d[5]) for d in DESCRIPTION}
    parent = {d[2]: d[1] for d in DESCRIPTION}
    listed = []

    def offset(v):
        return "OFFSET " + " ".join(f"{c:.9f}" for c in scale * frame @ mirror @ v)

    def add(bone):
        listed.append(bone)
        lines = ["{", offset(centre[bone] - (centre[parent[bone]] if bone in parent else 0))]
        lines += ["CHANNELS 3 " + " ".join(f"{c}rotation" for c in order)]
        below = [b for b, p in parent.items() if p == bone]
        for child in below:
            lines += [f"JOINT {rename(child)}", *add(child)]
        if not below:
            lines += ["End Site", "{", offset(tips()[int(bone[-1])] - centre[bone]), "}"]
        return [*lines, "}"]

    lines = ["HIERARCHY", f"ROOT {rename('carpals')}", *add("carpals"), "MOTION"]
    lines += [f"Frames: {len(poses)}", "Frame Time: 0.04"]
    hand = Rotation.from_euler("xyz", [0.3, -0.5, 0.9]).as_matrix()  # the whole hand moves, too
    for angles in poses:
        row = []
        for bone in listed:
            world = posed(np.zeros(3), bone, angles)[1]
            above = posed(np.zeros(3), parent[bone], angles)[1].T if bone in parent else hand
            local = frame @ mirror @ above @ world @ mirror @ frame.T
            row += list(Rotation.from_matrix(local).as_euler(order, degrees=True))
        lines += [" ".join(f"{v:.9f}" for v in row)]
    return "\n".join(lines)


def close(frames, tolerance=1e-4):
    return all(
        found == pytest.approx(truth, abs=tolerance)
        for found, truth in zip(frames.values(), POSES, strict=True)
    )


def test_angles_of_a_file_in_the_rigs_frame(tmp_path):
    (tmp_path / "a.bvh").write_text(text(POSES))
    frames = read_bvh_angles(tmp_path / "a.bvh", RIG)
    assert list(frames) == bvh_frame_names(tmp_path / "a.bvh") == ["frame1", "frame2"]
    assert close(frames, 1e-3)


def test_another_frame_scale_order_and_other_names_change_nothing(tmp_path):
    frame = Rotation.from_euler("xyz", [1.2, 0.4, -2.0]).as_matrix()
    (tmp_path / "a.bvh").write_text(text(POSES, frame, 0.1, "XYZ", lambda b: f"Right {b}"))
    names = {b: f"Right {b}" for b in RIG.bones}
    assert close(read_bvh_angles(tmp_path / "a.bvh", RIG, names), 1e-3)


def test_another_rest_pose_gives_the_same_directions_of_bones(tmp_path):
    """The file's fingers are bent at rest, as an artist may have drawn them; they point as the rig's do."""
    plain = rig(residuals=False)
    bend = {n: np.radians(20) if n[:3] in ("PIP", "DIP") else 0.0 for n in plain.angle_names}
    truth = {n: np.radians(30) if n[:3] in ("PIP", "DIP") else 0.0 for n in plain.angle_names}
    rest = plain.bone_transforms(bend)
    bent = type(plain)(
        plain.root,
        tuple(replace(j, fit=replace(j.fit, centre=rest[j.parent](j.fit.centre))) for j in plain.joints),
        {b: s.moved(rest[b](s.vertices)) for b, s in plain.surfaces.items()},
        {},
    )
    bvh = bvh_of(bent, {"a": truth})
    for i, bone in enumerate(j.name for j in bvh.joints):  # what the bones do from their bent rest
        world = [plain.bone_transforms(truth)[b].rotation @ rest[b].rotation.T for b in plain.bones]
        turned = dict(zip(plain.bones, world, strict=True))
        above = turned[plain.parents[bone]].T if bone in plain.parents else np.eye(3)
        local = Rotation.from_matrix(above @ turned[bone]).as_euler("ZXY", degrees=True)
        bvh.values[0, 3 + 3 * i : 6 + 3 * i] = local
    write_bvh(tmp_path / "bent.bvh", bvh)
    found = read_bvh_angles(tmp_path / "bent.bvh", plain)["frame1"]
    # The file's axes are fitted to its joints, bent and straight: a few degrees are between them.
    fingers = [n for n in truth if n.startswith("PIP")]
    assert [found[n] for n in fingers] == pytest.approx([truth[n] for n in fingers], abs=np.radians(3))


def test_a_mirrored_file_drives_the_mirrored_hand(tmp_path):
    (tmp_path / "a.bvh").write_text(text(POSES))
    (tmp_path / "left.bvh").write_text(text(POSES, mirror=MIRROR))
    right = read_bvh_angles(tmp_path / "a.bvh", RIG)
    left = read_bvh_angles(tmp_path / "left.bvh", rig(mirrored=True))
    for a, b in zip(left.values(), right.values(), strict=True):
        assert a == pytest.approx(b, abs=1e-4)


def test_what_is_written_reads_back(tmp_path):
    poses = {"a": POSES[0], "b": POSES[1]}
    write_bvh(tmp_path / "own.bvh", bvh_of(RIG, poses))
    assert close(read_bvh_angles(tmp_path / "own.bvh", RIG), 1e-3)
    rotations = read_bvh(tmp_path / "own.bvh").rotations()
    for i, pose in enumerate(POSES):
        for bone in RIG.bones:
            assert np.allclose(rotations[bone][i], posed(np.zeros(3), bone, pose)[1], atol=1e-6)


def test_angles_stay_within_limits(tmp_path):
    beyond = POSES[0] | {"PIP3_flexion": np.radians(130)}
    (tmp_path / "a.bvh").write_text(text([beyond]))
    found = read_bvh_angles(tmp_path / "a.bvh", RIG)["frame1"]
    assert found["PIP3_flexion"] == pytest.approx(np.radians(110), abs=1e-9)


def test_least_rotation():
    a, b = np.array([1.0, 2, 3]), np.array([-2.0, 0.5, 1])
    turn = least_rotation(a, b)
    assert np.allclose(turn @ a / np.linalg.norm(a), b / np.linalg.norm(b))
    assert np.allclose(turn @ np.cross(a, b), np.cross(a, b)) and np.isclose(np.linalg.det(turn), 1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.replace("HIERARCHY", "MOTION", 1), r"line 1: does not begin with HIERARCHY"),
        (lambda t: t.replace("CHANNELS 3", "CHANNELS 4", 1), r"line 5: gives another number of channels"),
        (lambda t: t.replace("Zrotation", "Wrotation", 1), r"line 5: has the unknown channel 'Wrotation'"),
        (lambda t: t.replace("Frames: 2", "Frames: 3"), "line 103 gives 3 frames, but 2 rows follow"),
        (lambda t: t.replace("Frames: 2", "Frames: 1"), "line 103 gives 1 frames, but 2 rows follow"),
        (lambda t: t.replace("Frames: 2", "Frames: 2.5"), "line 103: is no number of frames"),
        (lambda t: t.replace("Frames: 2", "Frames: 0"), "line 103: is no number of frames"),
        (lambda t: t + " 1_0", "something that is not a number"),
        (lambda t: t + " nan", "needs 48 finite numbers"),
        (lambda t: "HIERARCHY\nROOT a\n{\n" + "".join(f"JOINT b{i}\n{{\n" for i in range(5000)), "too deep"),
        (lambda t: t[: t.rindex(" ")], "needs 48 finite numbers, not 47"),
        (lambda t: t.replace("JOINT proximal3", "JOINT proximal2"), "names a second joint 'proximal2'"),
        (lambda t: t.replace("al", "el").replace("middle", "m"),
         "none is named as a bone"),
    ],
)  # fmt: skip
def test_wrong_files(tmp_path, change, message):
    path = tmp_path / "wrong.bvh"
    path.write_text(change(text(POSES)))
    with pytest.raises(InputError, match=message):
        read_bvh_angles(path, RIG)


def test_another_skeleton_is_refused(tmp_path):
    names = {b: b for b in RIG.bones}
    swapped = names | {"distal2": "metacarpal1", "metacarpal1": "distal5", "proximal5": "distal2"}
    (tmp_path / "a.bvh").write_text(text(POSES, Rotation.from_euler("x", 0.5).as_matrix()))
    with pytest.raises(InputError, match="do not lie as the rig's do"):
        read_bvh_angles(tmp_path / "a.bvh", RIG, swapped)
    with pytest.raises(InputError, match="is not a joint of this file"):
        read_bvh_angles(tmp_path / "a.bvh", RIG, {"distal2": "Index3"})
    with pytest.raises(InputError, match="does not exist"):
        read_bvh(tmp_path / "nowhere.bvh")
