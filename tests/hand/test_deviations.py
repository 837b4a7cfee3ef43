"""Stated deviations, against drawn functions and drawn motions whose errors are known."""

from pathlib import Path

import meshio
import numpy as np
import pytest

from handpipe.core import Frame, RigidTransform, Shape, artifacts
from handpipe.hand import write_vtu_series
from handpipe.hand.deviations import BodyDeviation, HandDeviations, JointDeviation, with_deviations
from handpipe.hand.deviations.body import left_out_scale
from handpipe.hand.deviations.bones import posed_covariances, scanned_covariances, variance_at
from handpipe.hand.deviations.stated_frames import write_stated
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones import Registration
from handpipe.skeleton.posing import PoseSpace, prediction_variance
from handpipe.skeleton.rig import Rig, StatedJoint, stated_rig

BONES = ("root", "near", "far")
CORNERS = np.stack(np.meshgrid([0, 30.0], [-4, 4.0], [-3, 3.0], indexing="ij"), axis=-1).reshape(-1, 3)
LIMITS = np.radians([[-20, 100.0]])
PLACES = np.array([0.0, 0.4, 0.9, 1.3])  # rad, of both joints in the poses of the fit


def surface(number: int) -> Surface:
    return Surface(CORNERS + [35.0 * number, 0, 0], np.array([[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7]]))


SURFACES = {bone: surface(i) for i, bone in enumerate(BONES)}


def rig() -> Rig:
    joints = [
        StatedJoint(child, parent, child, (child,), LIMITS, np.array([[0, 1.0, 0]]), np.array([x, 0, 0.0]))
        for parent, child, x in (("root", "near", 32.5), ("near", "far", 67.5))
    ]
    return stated_rig(joints, SURFACES, {"bent": {"near": 0.9, "far": 0.9}})


def joint(parent: str, child: str) -> JointDeviation:
    angles = PoseSpace((parent, child), parent, PLACES[:, None], tuple("0123"), "rbf")
    return JointDeviation(parent, child, (child,), angles, np.array([0.01**2, 0.2**2]), np.array([4e-4, 0.3]))


JOINTS = (joint("root", "near"), joint("near", "far"))


def frame(name: str, near: float, far: float) -> Frame:
    angles = {"near": near, "far": far}
    return Frame(name, angles, rig().bone_transforms(angles))


def space() -> PoseSpace:
    poses = {f"pose{i}": frame("", a, a).bones for i, a in enumerate(PLACES)}
    return PoseSpace.build(BONES, {"near": "root", "far": "near"}, poses, "rbf")


def hand() -> HandDeviations:
    n, x = len(CORNERS), SURFACES["far"].vertices[:, 0]
    carried = np.tile([0.0, 0.2, 0.8], (n, 1))
    scale, fits = 0.2 * x / x.max(), {"bent": np.full(n, 0.01)}
    body = BodyDeviation("skin", {"": space()}, np.ones((n, 1)), scale, fits, carried, np.zeros(n))
    return HandDeviations(BONES, JOINTS, {"bent": {b: 1e-4 * np.eye(6) for b in BONES}}, {"skin": body}, 0.5)


def layers(there: Frame) -> dict[str, dict[str, Shape]]:
    moved = {b: Shape(s.vertices, there.bones[b](s.vertices), s.triangles) for b, s in SURFACES.items()}
    skin = Shape(CORNERS, there.bones["far"](SURFACES["far"].vertices), SURFACES["far"].triangles)
    return {"bones": moved, "fat": {"skin": skin, "fat_mesh": skin}}


def test_drawn_corrections_are_within_two_deviations_in_95_percent_of_new_poses() -> None:
    """Brownian functions over poses, three times as rough in one half of a body as in the other."""
    rng = np.random.default_rng(1)
    places = rng.uniform([0, 0, 0], [60, 20, 2.0], (3000, 3))
    size = np.where(places[:, 0] < 30, 0.3, 0.9)
    examples = np.vstack([np.zeros(2), rng.uniform(0, 1.4, (6, 2))])
    new = rng.uniform(0, 1.6, (12, 2))
    points = np.vstack([examples, new])
    far = np.linalg.norm(points, axis=1)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2)
    covariance = far[:, None] + far[None] - apart + 2 * points @ points.T
    drawn = size * rng.multivariate_normal(np.zeros(len(points)), covariance, 3000, method="eigh").T
    known = PoseSpace(("a", "b"), "a", examples, tuple(map(str, range(7))), "rbf")
    shares = np.ones((3000, 1))
    scale = left_out_scale([known], shares, drawn[:7, :, None], places)
    stated = [np.sqrt(scale * prediction_variance(known, pose)) for pose in new]
    missed = [np.abs(t - known.weights_at(p) @ drawn[:7]) for p, t in zip(new, drawn[7:], strict=True)]
    within = np.array(missed) <= 2 * np.array(stated)
    rough, smooth = places[:, 0] > 35, places[:, 0] < 25
    assert 0.94 < within.mean() < 0.98
    assert 0.92 < within[:, rough].mean() < 0.97
    assert within[:, smooth].mean() > 0.94, (
        "a share of the whole body counts everywhere: the smooth half is safe"
    )
    assert 3 < scale[rough].mean() / scale[smooth].mean() < 9


def test_the_deviation_is_least_at_the_scans_and_large_in_a_pose_far_outside_of_them() -> None:
    stated = {
        name: hand().of_frame(rig(), there, layers(there))
        for name, there in {
            "scan": frame("scan", 0.9, 0.9),
            "between": frame("between", 0.65, 0.65),
            "far": frame("far", -1.2, 2.9),
        }.items()
    }
    for layer, body, more in (("fat", "skin", 2.5), ("bones", "far", 2.0), ("bones", "near", 2.0)):
        scan, between, far = (stated[name][layer][body] for name in ("scan", "between", "far"))
        assert (scan < between).all() and (far > more * between).all()
    assert set(stated["far"]["fat"]) == {"skin"}, "of a body that nothing is known of nothing is stated"


def test_errors_of_joints_add_up_along_a_chain() -> None:
    """Turns and shifts drawn for each joint; what they do to the last bone, against its covariance."""
    there, hand_rig = frame("bent", 1.1, 0.2), rig()
    stated = posed_covariances(hand_rig, JOINTS, there.angles, there.bones)
    rng, points = np.random.default_rng(2), there.bones["far"](SURFACES["far"].vertices)
    middles = {b: there.bones[b](s.vertices.mean(axis=0)[None])[0] for b, s in SURFACES.items()}
    moved = np.zeros((20000, len(points), 3))
    for each in JOINTS:
        turn, shift = np.sqrt(each.variance(there.angles) / 3)
        turns, shifts = turn * rng.normal(size=(20000, 1, 3)), shift * rng.normal(size=(20000, 1, 3))
        moved += np.cross(turns, points - middles[each.child]) + shifts
    expected = (moved**2).sum(axis=2).mean(axis=0)
    np.testing.assert_allclose(variance_at(stated["far"], points - middles["far"]), expected, rtol=0.04)
    assert not stated["root"].any()
    fewer = {bone: motion for bone, motion in there.bones.items() if bone != "near"}
    assert set(posed_covariances(hand_rig, JOINTS, there.angles, fewer)) == {"root"}


def test_a_scanned_bone_has_the_covariance_of_its_registration_in_the_axes_of_the_root() -> None:
    """Displacements drawn in the scanner's frame, brought home; and what the rig is off comes on top."""
    hand_rig, rng = rig(), np.random.default_rng(4)
    home = RigidTransform.fit(CORNERS, CORNERS @ np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]) + 7)
    posed = type(hand_rig.poses["bent"])(home, hand_rig.poses["bent"].angles)
    hand_rig.poses["bent"] = posed
    bones = hand_rig.scanned_bones("bent")
    root = rng.normal(size=(6, 6)) * np.repeat([0.01, 0.2], 3)[:, None]
    covariance = root @ root.T
    off = RigidTransform(np.eye(3), np.array([0.3, -0.1, 0.2]))
    registered = {"far": Registration(home @ off @ bones["far"], 0.1, covariance)}
    found = scanned_covariances(hand_rig, "bent", registered, bones)
    points = bones["far"](SURFACES["far"].vertices)
    arms = points - points.mean(axis=0)
    expected = (
        0.14
        + np.array([Registration(home, 0.1, covariance).deviation_at(home.rotation @ a) for a in arms]) ** 2
    )
    np.testing.assert_allclose(variance_at(found["far"], arms), expected, rtol=1e-9)
    doubted = {"far": Registration(bones["far"], 0.1, covariance, doubt="fits nowhere")}
    assert scanned_covariances(hand_rig, "bent", doubted, bones) == {}


def test_a_file_keeps_what_is_stated_and_series_carry_it(tmp_path: Path) -> None:
    known, frames = hand(), [frame("one", 0.1, 0.5), frame("two", 0.2, 1.2)]
    known.save(tmp_path / "deviations.h5")
    again = HandDeviations.load(tmp_path / "deviations.h5")
    stated = with_deviations([(there, layers(there)) for there in frames], rig(), again)
    write_vtu_series(tmp_path / "vtk", stated)
    write_stated(tmp_path / "stated.h5", stated, rig(), again)
    data = artifacts.read(tmp_path / "stated.h5", "frame_deviations")
    assert [str(name) for name in data["names"]] == ["one", "two"]
    for number, there in enumerate(frames):
        expected = known.of_frame(rig(), there, layers(there))
        shown = meshio.read(tmp_path / f"vtk/fat/skin-{number:04d}.vtu")
        np.testing.assert_allclose(shown.point_data["deviation"], expected["fat"]["skin"])
        kept = data["frames"][f"{number:06d}"]
        np.testing.assert_allclose(kept["layers"]["fat"]["skin"], expected["fat"]["skin"], rtol=1e-6)
        covariance = known.of_bones(rig(), there)["far"]
        assert kept["bones"]["far"]["translation"] == pytest.approx(np.sqrt(np.trace(covariance[3:, 3:])))
