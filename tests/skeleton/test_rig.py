from pathlib import Path

import numpy as np
import pytest
from manufactured import bone, motion, noisy, turn, unit

from handpipe.config import load_dataset
from handpipe.errors import InputError
from handpipe.mesh.rigid import RigidTransform
from handpipe.skeleton.bodies import bodies, moved_as_one
from handpipe.skeleton.rig import Rig, joint_point, outwards
from handpipe.skeleton.table import joint_table

DATASET = load_dataset(Path(__file__).parents[2] / "config/datasets/phantom-finger.yaml")
LENGTHS = {"metacarpal2": 0.0, "proximal2": 40.0, "middle2": 78.0, "distal2": 116.0}
SURFACES = {b: bone(24, 20).moved(bone(24, 20).vertices + [x, 0, 0]) for b, x in LENGTHS.items()}
AXES = {
    "MP2": (unit([0.05, 1, 0.1]), unit([0.0, -0.1, 1])),
    "PIP2": (unit([-0.1, 1, 0.05]),),
    "DIP2": (unit([0.1, 1, -0.1]),),
}
CENTRES = {
    "MP2": np.array([20.0, 0.5, -1]),
    "PIP2": np.array([59.0, 0, -1.5]),
    "DIP2": np.array([97.0, 0, -1]),
}
DEGREES = {  # MP2 flexion and abduction, PIP2, DIP2
    "neutral": (0, 0, 0, 0),
    "bow": (70, 2, 5, 3),
    "hook": (5, -3, 95, 55),
    "fist": (80, 0, 100, 60),
    "spread": (10, 15, 8, 5),
    "curl": (40, -12, 60, 30),
    "half": (45, 5, 45, 25),
    "reach": (25, -6, 20, 40),
}
NAMES = ("MP2_flexion", "MP2_abduction", "PIP2_flexion", "DIP2_flexion")
ANGLES = {p: dict(zip(NAMES, np.radians(d), strict=True)) for p, d in DEGREES.items()}
ROOTS = {
    p: RigidTransform(turn([0.1 * i, -0.05, 0.02 * i]), np.array([3.0 * i, 1, -2]))
    for i, p in enumerate(DEGREES)
}
ROOTS["neutral"] = RigidTransform.identity()
FIT = list(DATASET.examples)
TREE = (("MP2", "metacarpal2", "proximal2"), ("PIP2", "proximal2", "middle2"), ("DIP2", "middle2", "distal2"))


def manufactured(glide=0.0, degrees=0.0, mm=0.0, seed=0):
    """Bone transforms of all poses, with residual motions of `glide` times a few degrees, and noise."""
    rng = np.random.default_rng(seed)
    poses = {}
    for pose, angles in ANGLES.items():
        bones = {"metacarpal2": ROOTS[pose]}
        for joint, parent, child in TREE:
            values = [angles[n] for n in DATASET.joints[joint].angles]
            phi = values[0]
            side = unit(np.cross(AXES[joint][0], [1, 0, 0]))
            rotation = glide * 0.05 * (phi**2 - 0.4 * phi) * side
            translation = glide * 0.4 * np.array([phi**2, 0.3 * phi, -0.6 * phi**2])
            bones[child] = bones[parent] @ motion(AXES[joint], CENTRES[joint], values, rotation, translation)
        if pose != "neutral":
            bones = {
                b: noisy(t, rng, degrees, mm, at=SURFACES[b].vertices.mean(axis=0)) for b, t in bones.items()
            }
        poses[pose] = bones
    return poses


def vertex_error(found, truth):
    return max(np.abs(found[b](SURFACES[b].vertices) - truth[b](SURFACES[b].vertices)).max() for b in truth)


def test_exact_motions_are_reproduced_in_unseen_poses():
    transforms = manufactured()
    rig = Rig.fit(DATASET, transforms, SURFACES, FIT)
    assert rig.bones == ("metacarpal2", "proximal2", "middle2", "distal2")
    for pose in ("half", "reach", "neutral"):
        assert rig.poses[pose].angles == pytest.approx(ANGLES[pose], abs=1e-6)
        assert vertex_error(rig.bone_transforms(ANGLES[pose], ROOTS[pose]), transforms[pose]) < 1e-4
    at_rest = rig.bone_transforms(ANGLES["half"])
    assert np.array_equal(at_rest["metacarpal2"].rotation, np.eye(3))


def test_full_model_beats_the_partial_one_on_unseen_poses():
    transforms = manufactured(glide=1.0, degrees=0.15, mm=0.05)
    rig = Rig.fit(DATASET, transforms, SURFACES, FIT)
    table = joint_table(rig, DATASET, transforms, FIT)
    m = {k: v for k, (v, _) in table.metrics.items()}
    assert m["rotation_error_mean"] < 1.0 and m["translation_error_mean"] < 0.25
    assert m["rotation_error_mean"] < m["partial_rotation_error_mean"]
    for kind in ("rotation", "translation", "bone"):
        assert m[f"heldout_{kind}_error_mean"] < m[f"heldout_partial_{kind}_error_mean"]
    assert m["loo_rotation_error_mean"] > m["rotation_error_mean"]
    assert [r["joint"] for r in table.rows] == ["MP2", "PIP2", "DIP2"]
    assert {"FM_R", "PM_R", "FM_x", "PM_x", "loo_FM_R", "heldout_PM_x"} <= set(table.rows[0])


def test_the_table_measures_what_it_says():
    transforms = manufactured()
    rig = Rig.fit(DATASET, transforms, SURFACES, FIT)
    axis = np.array([1.0, 0, 0])  # off the hinges, so that no angle makes up for it
    half = dict(transforms["half"])
    middle = SURFACES["distal2"].vertices.mean(axis=0)
    half["distal2"] = (
        RigidTransform(np.eye(3), np.array([0, 0, 0.7]))
        @ RigidTransform.about(
            half["distal2"](middle),
            half["distal2"].rotation @ turn(np.radians(5) * axis) @ half["distal2"].rotation.T,
        )
        @ half["distal2"]
    )
    table = joint_table(
        rig, DATASET, {"neutral": transforms["neutral"], **{p: transforms[p] for p in FIT}, "half": half}, FIT
    )
    row = table.rows[2]
    assert row["heldout_PM_R"] == pytest.approx(5, abs=0.1)
    assert row["heldout_PM_x"] == pytest.approx(0.7, abs=0.35)
    assert row["FM_R"] < 1e-4


def test_a_bone_that_is_missing_in_a_pose_does_not_stop_the_fit():
    transforms = manufactured()
    del transforms["curl"]["distal2"]
    del transforms["hook"]["metacarpal2"]
    rig = Rig.fit(DATASET, transforms, SURFACES, FIT)
    assert "hook" not in rig.poses
    assert joint_table(rig, DATASET, transforms, FIT).metrics["bone_error_mean"][0] < 1e-3
    assert rig.poses["curl"].angles["PIP2_flexion"] == pytest.approx(ANGLES["curl"]["PIP2_flexion"], abs=1e-6)
    assert vertex_error(rig.bone_transforms(ANGLES["half"], ROOTS["half"]), transforms["half"]) < 1e-4


def test_bones_that_move_as_one(tmp_path):
    """A joint without degrees of freedom carries its bone along; it is no row of the table."""
    middle = DATASET.joints["PIP2"].model_copy(update={"angles": (), "limits_deg": (), "axis_hints": ()})
    fused = DATASET.model_copy(update={"joints": DATASET.joints | {"PIP2": middle}})
    transforms = manufactured()
    stiff = {
        p: {**bones, "middle2": bones["proximal2"], "distal2": bones["proximal2"]}
        for p, bones in transforms.items()
    }
    rig = Rig.fit(fused, stiff, SURFACES, FIT)
    assert rig.angle_names == ("MP2_flexion", "MP2_abduction", "DIP2_flexion")
    assert rig.poses["fist"].angles == pytest.approx(
        {n: ANGLES["fist"][n] for n in NAMES[:2]} | {"DIP2_flexion": 0.0}, abs=1e-6
    )
    assert vertex_error(rig.bone_transforms(rig.poses["half"].angles, ROOTS["half"]), stiff["half"]) < 1e-4
    rig.save(tmp_path / "rig.h5")
    again = Rig.load(tmp_path / "rig.h5")
    assert again.limits == rig.limits and again.joints[1].angles == ()
    assert [r["joint"] for r in joint_table(rig, fused, stiff, FIT).rows] == ["MP2", "DIP2"]


def test_bones_that_move_as_one_share_their_registrations():
    middle = DATASET.joints["PIP2"].model_copy(update={"angles": (), "limits_deg": (), "axis_hints": ()})
    fused = DATASET.model_copy(update={"joints": DATASET.joints | {"PIP2": middle}})
    assert bodies(fused) == [("proximal2", "middle2")] and bodies(DATASET) == []
    rng, truth = np.random.default_rng(0), manufactured()["fist"]["proximal2"]
    errors = []
    for _ in range(20):
        seen = {
            b: noisy(truth, rng, d, 0.0, at=SURFACES[b].vertices.mean(axis=0))
            for b, d in (("proximal2", 0.5), ("middle2", 0.5))
        }
        one = moved_as_one(fused, {"fist": seen}, SURFACES)["fist"]
        assert one["proximal2"] is one["middle2"]
        errors.append([np.degrees(t.angle_to(truth)) for t in (seen["middle2"], one["middle2"])])
    # Two centroids far apart fix two of three turns; the turn about their line is a mean of two.
    single, both = np.sqrt((np.array(errors) ** 2).mean(axis=0))
    assert both < 0.6 * single
    lacking = moved_as_one(fused, {"fist": {"proximal2": truth}}, SURFACES)["fist"]
    assert np.allclose(lacking["middle2"].rotation, truth.rotation, atol=1e-12)


def test_no_pose_to_learn_from():
    with pytest.raises(InputError, match="MP2"):
        Rig.fit(DATASET, manufactured(), SURFACES, [])


def test_round_trip(tmp_path):
    transforms = manufactured(glide=1.0, degrees=0.2, mm=0.1)
    rig = Rig.fit(DATASET, transforms, SURFACES, FIT)
    rig.save(tmp_path / "rig.h5")
    again = Rig.load(tmp_path / "rig.h5")
    assert again.bones == rig.bones and again.angle_names == rig.angle_names and again.limits == rig.limits
    assert list(again.poses) == list(rig.poses)
    assert again.poses["fist"].angles == rig.poses["fist"].angles
    assert np.array_equal(again.poses["fist"].root.rotation, ROOTS["fist"].rotation) is False  # noise is kept
    angles = dict.fromkeys(rig.angle_names, 0.3)
    for b, t in rig.bone_transforms(angles).items():
        assert np.array_equal(t.rotation, again.bone_transforms(angles)[b].rotation)
        assert np.array_equal(again.surfaces[b].triangles, SURFACES[b].triangles)


def test_a_saddle_is_kept_in_the_artifact(tmp_path):
    joint = DATASET.joints["MP2"].model_copy(update={"type": "saddle"})
    saddled = DATASET.model_copy(update={"joints": DATASET.joints | {"MP2": joint}})
    transforms = manufactured(glide=1.0, degrees=0.2, mm=0.1)
    rig = Rig.fit(saddled, transforms, SURFACES, FIT)
    assert rig.joints[0].fit.type == "saddle" and rig.joints[0].fit.offset.any()
    rig.save(tmp_path / "rig.h5")
    again = Rig.load(tmp_path / "rig.h5")
    assert np.array_equal(again.joints[0].fit.offset, rig.joints[0].fit.offset)
    for name, t in rig.bone_transforms(ANGLES["half"]).items():
        assert np.array_equal(t.translation, again.bone_transforms(ANGLES["half"])[name].translation)
    assert "loo_FM_R" in joint_table(rig, saddled, transforms, FIT).rows[0]


def test_limits():
    rig = Rig.fit(DATASET, manufactured(), SURFACES, FIT)
    angles = dict(ANGLES["half"])
    rig.check_limits(angles, "pose")
    with pytest.raises(InputError, match=r"DIP2_flexion: 85 deg is outside its limits of -10 to 80 deg"):
        rig.check_limits(angles | {"DIP2_flexion": np.radians(85)}, "pose")


def test_joints_are_ordered_from_the_root():
    backwards = DATASET.model_copy(update={"joints": dict(reversed(DATASET.joints.items()))})
    assert outwards(backwards) == ["MP2", "PIP2", "DIP2"]


def test_joint_point_lies_in_the_gap():
    point = joint_point(SURFACES["metacarpal2"], SURFACES["proximal2"])
    assert point == pytest.approx([20, 0, 0], abs=1.5)
