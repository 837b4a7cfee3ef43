from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from manufactured import bone, motion, noisy, off_by, turn, unit
from scipy.optimize import least_squares

from handpipe.core import artifacts
from handpipe.core.configuration.dataset import load_dataset
from handpipe.core.errors import InputError
from handpipe.core.rigid import RigidTransform
from handpipe.evaluation.table import rig_table
from handpipe.skeleton.bones.bodies import bodies, moved_as_one
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.joints.joint_knowledge import JointKnowledge
from handpipe.skeleton.joints.joints import fit_joint
from handpipe.skeleton.joints.limits import limit_rows
from handpipe.skeleton.joints.prior import MotionNoise
from handpipe.skeleton.rig.displacement import displacement, displacement_rates, moments
from handpipe.skeleton.rig.explaining import explain
from handpipe.skeleton.rig.rig import Rig, joint_point, outwards
from handpipe.skeleton.rig.table import joint_table
from handpipe.skeleton.rig.twists import moving_bones

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


def test_angles_on_either_side_of_a_missing_bone():
    """What hangs on the missing bone tells both angles, flexed as they are and not bent backwards."""
    transforms = {p: dict(t) for p, t in manufactured().items()}
    for pose in ("half", "reach"):
        del transforms[pose]["proximal2"]
    transforms["closed"] = {b: t for b, t in transforms["fist"].items() if b != "proximal2"}
    rig = Rig.fit(DATASET, transforms, SURFACES, FIT)
    for pose, true in (("half", "half"), ("reach", "reach"), ("closed", "fist")):
        assert rig.poses[pose].angles == pytest.approx(ANGLES[true], abs=1e-5)


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


@pytest.mark.parametrize("model", ["full", "partial"])
def test_angles_are_those_of_numerical_derivatives(model):
    """scipy's own differences of the displacements, written out, end in the same angles."""
    rig = Rig.fit(DATASET, manufactured(glide=1.0, degrees=0.2, mm=0.1), SURFACES, FIT)
    wanted = manufactured(glide=1.3, degrees=1.0, mm=0.3, seed=5)["reach"]
    found = rig.angles_of(wanted, model)

    def residual(values):
        bones = rig.bone_transforms(dict(zip(NAMES, values, strict=True)), wanted["metacarpal2"], model)
        return np.concatenate(
            [(bones[b](SURFACES[b].vertices) - wanted[b](SURFACES[b].vertices)).ravel() for b in SURFACES]
        )

    start = [found[n] + 0.05 for n in NAMES]
    differences = least_squares(residual, start, jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    # Differences end within about 1e-8 of the minimum, where their objective is the larger one.
    assert [found[n] for n in NAMES] == pytest.approx(differences, abs=5e-8)


def test_rates_of_displacements():
    rig = Rig.fit(DATASET, manufactured(glide=1.0, degrees=0.2, mm=0.1), SURFACES, FIT)
    wanted, h = manufactured(seed=3)["curl"], 1e-6
    for name in ("proximal2", "distal2"):
        of_bone = moments(SURFACES[name])

        def moved(angles, name=name, of_bone=of_bone):
            bones = rig.bone_transforms(angles, wanted["metacarpal2"])
            return displacement(bones[name], wanted[name], of_bone)

        rates = displacement_rates(moving_bones(rig, ANGLES["half"], wanted["metacarpal2"])[name], of_bone)
        for i, angle in enumerate(NAMES):
            ahead, back = (moved(ANGLES["half"] | {angle: ANGLES["half"][angle] + s}) for s in (h, -h))
            assert np.allclose(rates[:, i], (ahead - back) / (2 * h), atol=1e-6)
        square = (moved(ANGLES["half"]) ** 2).sum()
        bones = rig.bone_transforms(ANGLES["half"], wanted["metacarpal2"])
        apart = bones[name](SURFACES[name].vertices) - wanted[name](SURFACES[name].vertices)
        assert square == pytest.approx((apart**2).sum(axis=1).mean(), rel=1e-9)


def uncertain(transforms, degrees, mm):
    covariance = np.diag([np.radians(degrees) ** 2] * 3 + [mm**2] * 3)
    return {
        p: {b: Registration(t, 0.03, covariance) for b, t in bones.items()} for p, bones in transforms.items()
    }


def test_a_pose_that_is_hardly_known_hardly_counts():
    transforms = {p: dict(t) for p, t in manufactured(degrees=0.1, mm=0.03).items()}
    rng = np.random.default_rng(1)
    middle = SURFACES["middle2"].vertices.mean(axis=0)
    transforms["fist"]["middle2"] = noisy(transforms["fist"]["middle2"], rng, 6.0, 1.0, at=middle)
    known = uncertain(transforms, 0.1, 0.03)
    covariance = np.diag([np.radians(6.0) ** 2] * 3 + [1.0] * 3)
    weak = known | {
        "fist": known["fist"] | {"middle2": Registration(transforms["fist"]["middle2"], 0.03, covariance)}
    }
    truth = manufactured()

    def error(registrations):
        rig = Rig.fit(DATASET, transforms, SURFACES, FIT, registrations)
        fit = rig.joints[1].fit
        true = [
            truth[p]["proximal2"].inverse() @ truth[p]["middle2"] for p in ("half", "reach", "bow", "hook")
        ]
        turns, shifts = fit.errors(true, middle)
        return np.degrees(turns).mean() + shifts.mean()

    assert error(weak) < 0.4 * error(known)


def test_five_poses_lean_on_the_hints():
    """Neutral and four poses with little abduction: what the hint tells of its axis is not thrown away."""
    few = ["neutral", "bow", "hook", "fist", "half"]
    gains = []
    for seed in range(3):
        transforms = manufactured(glide=1.0, degrees=0.3, mm=0.05, seed=seed)
        tilts = []
        for registrations in (None, uncertain(transforms, 0.5, 0.09)):
            axes = Rig.fit(DATASET, transforms, SURFACES, few, registrations).joints[0].fit.axes
            tilts.append(np.degrees(np.arccos(min(1.0, axes.directions[1] @ AXES["MP2"][1]))))
        gains.append(tilts)
    alone, leaning = np.mean(gains, axis=0)
    assert leaning < 8 and leaning < 0.7 * alone
    # With motions that tell, hints that are ten degrees off do no harm.
    rig = Rig.fit(DATASET, transforms, SURFACES, FIT, uncertain(transforms, 0.5, 0.09))
    m = {k: v for k, (v, _) in joint_table(rig, DATASET, transforms, FIT).metrics.items()}
    assert m["heldout_rotation_error_mean"] < 1.5


def test_limits_that_nobody_states_are_what_is_known(tmp_path):
    free = {n: j.model_copy(update={"limits_deg": None}) for n, j in DATASET.joints.items()}
    open_dataset = DATASET.model_copy(update={"joints": DATASET.joints | {"PIP2": free["PIP2"]}})
    rig = Rig.fit(open_dataset, manufactured(), SURFACES, FIT)
    lower, upper = np.degrees(rig.limits["PIP2_flexion"])
    assert upper == pytest.approx(103, abs=0.1)  # seen: 100, and the margin
    assert lower <= 0 and np.degrees(rig.limits["DIP2_flexion"]) == pytest.approx([-10, 80])
    rows = {row["angle"]: row for row in limit_rows(rig)}
    assert rows["PIP2_flexion"]["seen_upper"] == pytest.approx(100, abs=1e-4)
    assert rows["DIP2_flexion"]["limit_upper"] == pytest.approx(80)
    assert rows["DIP2_flexion"]["reference_upper"] - rows["DIP2_flexion"]["reference_lower"] == pytest.approx(
        90
    )
    rig.save(tmp_path / "rig.h5")
    stored = artifacts.read(tmp_path / "rig.h5", "rig")["joints"]["PIP2"]
    assert np.degrees(stored["seen"]) == pytest.approx(np.array([[0, 100]]), abs=1e-4)
    assert stored["type"] == "hinge" and stored["reference"].shape == (1, 2)


def test_a_left_hand_is_a_right_one_in_the_mirror():
    """Mirrored motions, bones and hints give the mirrored rig: equal angles, equal errors."""
    mirror = np.array([1.0, -1.0, 1.0])
    transforms = manufactured(glide=1.0, degrees=0.2, mm=0.1)
    other = {
        p: {
            b: RigidTransform(t.rotation * np.outer(mirror, mirror), t.translation * mirror)
            for b, t in bones.items()
        }
        for p, bones in transforms.items()
    }
    surfaces = {b: s.moved(s.vertices * mirror).flipped() for b, s in SURFACES.items()}
    joints = {
        n: j.model_copy(update={"axis_hints": tuple(tuple(-np.array(h) * mirror) for h in j.axis_hints)})
        for n, j in DATASET.joints.items()
    }
    left = DATASET.model_copy(update={"joints": joints, "hand": "left"})
    a = Rig.fit(DATASET, transforms, SURFACES, FIT, uncertain(transforms, 0.3, 0.1))
    b = Rig.fit(left, other, surfaces, FIT, uncertain(other, 0.3, 0.1))
    for pose, fitted in a.poses.items():
        assert b.poses[pose].angles == pytest.approx(fitted.angles, abs=1e-5)
    for one, two in zip(a.joints, b.joints, strict=True):
        assert np.allclose(two.fit.axes.directions, -one.fit.axes.directions * mirror, atol=1e-5)
        assert np.allclose(two.fit.centre, one.fit.centre * mirror, atol=1e-4)
    right_table = joint_table(a, DATASET, transforms, FIT).rows[0]
    left_table = joint_table(b, left, other, FIT).rows[0]
    assert left_table["loo_FM_R"] == pytest.approx(right_table["loo_FM_R"], rel=1e-2)


def test_the_type_that_is_earned_stands_in_the_table():
    best = DATASET.joints["MP2"].model_copy(update={"type": "best"})
    chosen = DATASET.model_copy(update={"joints": DATASET.joints | {"MP2": best}})
    transforms = manufactured(degrees=0.2, mm=0.05)
    table = joint_table(Rig.fit(chosen, transforms, SURFACES, FIT), chosen, transforms, FIT)
    assert [row["type"] for row in table.rows] == ["universal", "hinge", "hinge"]
    assert [row["poses"] for row in table.rows] == [5, 5, 5]
    by_joint = [table.metrics[f"loo_rotation_error_{j}"][0] for j in ("MP2", "PIP2", "DIP2")]
    assert np.mean(by_joint) == pytest.approx(table.metrics["loo_rotation_error_mean"][0])
    assert table.metrics["paper_rotation_error_mean"] == (1.84, "deg")
    text = rig_table(table.rows).html()
    assert "MP2 (universal, 5 poses)" in text


def test_without_another_pose_every_joint_keeps_its_hints(caplog):
    """One scan alone: a rig of hints, which says so of every joint."""
    neutral = {"neutral": manufactured()["neutral"]}
    rig = Rig.fit(DATASET, neutral, SURFACES, ["neutral"])
    for joint in rig.joints:
        hints = np.array(DATASET.joints[joint.name].axis_hints)
        assert np.allclose(joint.fit.axes.directions, hints / np.linalg.norm(hints, axis=1, keepdims=True))
        assert not joint.knowledge.axes_told.any() and not joint.knowledge.centre_told
        assert f"joint {joint.name}: there is no example pose besides neutral" in caplog.text
    table = joint_table(rig, DATASET, neutral, ["neutral"])
    assert [row["poses"] for row in table.rows] == [0, 0, 0]
    assert "rotation_error_mean" not in table.metrics and "bone_error_mean" not in table.metrics
    assert rig_table(table.rows) is None or "PIP2" in rig_table(table.rows).html()


def without(bone, poses):
    return {p: {b: t for b, t in bones.items() if b != bone or p == "neutral"} for p, bones in poses.items()}


def test_a_bone_that_no_pose_has_leaves_the_rest_of_the_rig(tmp_path, caplog):
    """Its joint keeps its hint; the angles of the poses are not told, are NaN in the file, and are named."""
    truth = manufactured(degrees=0.1, mm=0.03)
    lacking = without("distal2", truth)
    rig = Rig.fit(DATASET, lacking, SURFACES, FIT)
    dip = rig.joints[2]
    assert dip.knowledge.poses == 0 and not dip.knowledge.axes_told.any()
    assert np.degrees(dip.knowledge.axes[0]) == pytest.approx(15)
    assert "joint DIP2: no example pose has both middle2 and distal2" in caplog.text
    for pose, fitted in rig.poses.items():
        assert fitted.undetermined == (set() if pose == "neutral" else {"DIP2_flexion"})
        for name in NAMES[:3]:
            assert np.degrees(fitted.angles[name] - ANGLES[pose][name]) == pytest.approx(0, abs=0.6)
        assert fitted.angles["DIP2_flexion"] == 0
    rig.save(tmp_path / "rig.h5")
    stored = artifacts.read(tmp_path / "rig.h5", "rig")["poses"]["fist"]
    assert np.isnan(stored["angles"]).tolist() == [False, False, False, True]
    again = Rig.load(tmp_path / "rig.h5")
    assert again.poses["fist"].undetermined == {"DIP2_flexion"}
    assert again.joints[2].knowledge.poses == 0
    # Readers: the angle's range is neutral's alone, and what needs the bone gets an error that names it.
    assert [row for row in limit_rows(again) if row["angle"] == "DIP2_flexion"][0]["seen_upper"] == 0
    bones = again.scanned_bones("fist")
    assert set(bones) == {"metacarpal2", "proximal2", "middle2"}
    with pytest.raises(InputError, match=r"poses\.fist: .* where distal2 is"):
        bones["distal2"]
    row = joint_table(rig, DATASET, lacking, FIT).rows[2]
    assert row["poses"] == 0 and "FM_R" not in row and "DIP2_flexion" in row["undetermined"]


def test_a_chain_cut_in_the_middle_by_a_bone_that_no_pose_has():
    """The distal bone tells both joints' angles together, within their limits' reach."""
    rig = Rig.fit(DATASET, without("middle2", manufactured()), SURFACES, FIT)
    for pose, fitted in rig.poses.items():
        assert all(abs(np.degrees(a)) < 150 for a in fitted.angles.values())
        total = sum(fitted.angles[n] for n in NAMES[2:])
        true = sum(ANGLES[pose][n] for n in NAMES[2:])
        assert np.degrees(total - true) == pytest.approx(0, abs=8)


def test_angles_that_bones_do_not_tell_stay_small_and_are_named():
    """Two joints share the motion of a bone that turns about both axes at one place: only the sum is told."""
    one = {
        n: j.model_copy(update={"axis_hints": ((0.0, 1.0, 0.0),)})
        for n, j in DATASET.joints.items()
        if n != "MP2"
    }
    dataset = DATASET.model_copy(update={"joints": DATASET.joints | one})
    poses = {
        p: {
            "metacarpal2": RigidTransform.identity(),
            "proximal2": RigidTransform.identity(),
            "distal2": motion([np.array([0.0, 1, 0])], CENTRES["PIP2"], [angle]),
        }
        for p, angle in (("bow", 0.4), ("fist", 0.8))
    }
    neutral = {"neutral": dict.fromkeys(SURFACES, RigidTransform.identity())}
    rig = Rig.fit(dataset, neutral | poses, SURFACES, ["neutral", *poses])
    together = [replace(j, fit=replace(j.fit, centre=CENTRES["PIP2"])) for j in rig.joints[1:]]
    shared = replace(rig, joints=(rig.joints[0], *together))
    for name, bones in poses.items():
        found = explain(shared, bones)
        assert found.undetermined == {"PIP2_flexion", "DIP2_flexion"}
        assert all(abs(a) < 1.0 for a in found.angles.values())
        assert found.angles["PIP2_flexion"] + found.angles["DIP2_flexion"] == pytest.approx(
            {"bow": 0.4, "fist": 0.8}[name], abs=1e-3
        )


def test_a_rig_does_not_depend_on_hints_that_are_thirty_degrees_off():
    """Motions tell the axes: of random hints the rig keeps the signs alone."""
    rng, errors = np.random.default_rng(0), {0.0: [], 30.0: []}
    truth = manufactured(glide=1.0)
    for seed in range(3):
        transforms = manufactured(glide=1.0, degrees=0.3, mm=0.05, seed=seed)
        for degrees, found in errors.items():
            rough = {
                n: j.model_copy(update={"axis_hints": tuple(map(tuple, off_by(rng, degrees, j.axis_hints)))})
                for n, j in DATASET.joints.items()
            }
            dataset = DATASET.model_copy(update={"joints": rough})
            rig = Rig.fit(dataset, transforms, SURFACES, FIT, uncertain(transforms, 0.3, 0.05))
            for pose in ("reach", "half"):
                bones = rig.bone_transforms(rig.angles_of(truth[pose]), ROOTS[pose])
                found.append(vertex_error(bones, truth[pose]))
    right, rough = np.mean(errors[0.0]), np.mean(errors[30.0])
    assert rough < 1.3 * right + 0.05


def test_neutral_that_lacks_a_bone_is_an_error():
    surfaces = {b: s for b, s in SURFACES.items() if b != "middle2"}
    with pytest.raises(InputError, match=r"bones\.middle2.*neutral"):
        Rig.fit(DATASET, manufactured(), surfaces, FIT)


def test_a_joint_that_hardly_turns_is_said_to_keep_its_hint():
    """The flexion of the MP is seen, its abduction is not; the deviation that is stated covers the error."""
    poses = {
        f"p{i}": motion(AXES["MP2"], CENTRES["MP2"], [a, 0.0]) for i, a in enumerate((0.3, 0.7, 1.0, 1.3))
    }
    noise = [MotionNoise(np.radians(0.2), 0.05)] * 4
    hints = np.array([[0, 1.0, 0], [0.1, 0, 1.0]])
    fit = fit_joint(list(poses.values()), 2, hints, near=CENTRES["MP2"], noise=noise)
    known = JointKnowledge.assess(fit, list(poses.values()), noise)
    assert known.poses == 4 and not known.axes_told[1]
    hinge = fit_joint(
        list(poses.values()), 1, hints[:1], near=CENTRES["MP2"] + 3 * AXES["MP2"][0], noise=noise
    )
    known = JointKnowledge.assess(hinge, list(poses.values()), noise)
    assert known.axes_told.all() and known.centre_told  # along the axis it does not count


def test_stated_deviations_of_axes_cover_their_errors():
    """Over draws of noise and of hints: errors by the stated deviation are of unit size."""
    rng, ratios = np.random.default_rng(0), []
    noise = [MotionNoise(np.radians(1.0), 0.1)] * 4
    for _ in range(60):
        axis = unit(rng.normal(size=3))
        across = np.linalg.svd(axis[None])[2][1:]
        hint = unit(axis + np.radians(10) * rng.normal(size=2) @ across)
        poses = [
            noisy(motion([axis], CENTRES["PIP2"], [a]), rng, 1.0, 0.1, at=CENTRES["PIP2"])
            for a in 0.25 * rng.random(4)
        ]
        fit = fit_joint(poses, 1, hint[None], near=CENTRES["PIP2"], noise=noise)
        tilt = np.arccos(min(1.0, abs(fit.axes.directions[0] @ axis)))
        ratios.append(tilt / JointKnowledge.assess(fit, poses, noise).axes[0])
    # A tilt has two components; the stated deviation is that of the larger.
    assert 0.8 < np.sqrt(np.mean(np.square(ratios))) < 1.7


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
