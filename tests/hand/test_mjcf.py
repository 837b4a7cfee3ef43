"""The model of MuJoCo, loaded and moved by MuJoCo itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from tests.tissues.tendons.finger import (
    BONES,
    DEPTH,
    JOINTS,
    PARENTS,
    RADIUS,
    bone_surfaces,
    flexor,
    pose,
    rest_tendon,
    true_rod,
)

from handpipe.core import metrics
from handpipe.core.layers import Frame
from handpipe.core.rigid import RigidTransform
from handpipe.hand.exports.bone_files import BONE_DENSITY
from handpipe.hand.exports.mjcf import residual_motion, write_mjcf
from handpipe.hand.frames import write_frames
from handpipe.mesh.surfaces.surface import Surface
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.joints import JointFit
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.rig import Rig
from handpipe.stages.views import export_skeleton
from handpipe.tissues.tendons.layer import TendonLayer
from handpipe.tissues.tendons.straight_path import BonePath, bone_path
from handpipe.tissues.tendons.tendon import RegisteredRods, Tendon, build_tendon

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
EXAMPLES = {"neutral": (0.0, 0.0), "middle": (1.0, 0.0), "distal": (0.0, 0.8), "fist": (1.5, 1.0)}
LIMITS = np.radians([[-20.0, 90.0]])


def no_residual(dof: int) -> Residual:
    return Residual(np.zeros(({0: 0, 1: 2, 2: 5, 3: 9}[dof], 3)), np.full(dof, -1.0), np.full(dof, 1.0))


def joint(name: str, parent: str, axes: Axes, x: float, offset=(0.0, 0, 0), shift=None) -> RigJoint:
    """A joint at x with limits that differ between its angles."""
    dof = axes.dof
    limits = np.radians([[-30.0 - 5 * i, 60.0 + 10 * i] for i in range(dof)]).reshape(-1, 2)
    still = no_residual(dof)
    moved = still if shift is None else Residual(shift, still.lower, still.upper)
    fit = JointFit(axes, np.array([x, 1.0, -2.0]), still, moved, np.zeros((0, dof)), np.array(offset))
    return RigJoint(name, parent, name, tuple(f"{name}_{i}" for i in range(dof)), limits, fit)


def every_type(shift: np.ndarray | None = None) -> Rig:
    """A chain of hinge, universal, saddle, ball and rigid joints with axes in general position."""
    a, b, c = np.linalg.qr(np.array([[1.0, 0.2, 0.1], [0.3, 1, -0.4], [-0.2, 0.1, 1]]))[0]
    oblique = (a + 0.4 * b) / np.linalg.norm(a + 0.4 * b)
    joints = (
        joint("hinge", "root", Axes(a[None], (0,)), 10.0, shift=shift),
        joint("universal", "hinge", Axes(np.array([a, b]), (1, 0)), 25.0),
        joint("saddle", "universal", Axes(np.array([oblique, b]), (0, 1)), 40.0, 3 * np.cross(oblique, b)),
        joint("ball", "saddle", Axes(np.array([a, b, c]), (0, 1, 2)), 55.0),
        joint("rigid", "ball", Axes(np.zeros((0, 3)), ()), 70.0),
    )
    surfaces = {}
    for number, bone in enumerate(("root", *(j.name for j in joints))):
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=3.0 + number)
        surfaces[bone] = Surface(np.asarray(mesh.vertices) + [15.0 * number, 0, 0], np.asarray(mesh.faces))
    return Rig("root", joints, surfaces, {})


def loaded(path: Path):
    model = mujoco.MjModel.from_xml_path(str(path))
    return model, mujoco.MjData(model)


def posed(model, data, angles: dict[str, float]) -> None:
    """Joints by name; positions, tendons and their Jacobians follow."""
    for name, value in angles.items():
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)


def jacobian(model, data, tendon: str) -> dict[str, float]:
    """Derivative of a tendon's length by each joint, in mm per rad."""
    row = np.zeros((model.ntendon, model.nv))
    mujoco.mju_sparse2dense(row, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind)
    found = 1e3 * row[model.tendon(tendon).id]
    return {model.joint(j).name: found[model.joint(j).dofadr[0]] for j in range(model.njnt)}


def test_bodies_move_as_the_rig_without_residuals(tmp_path: Path) -> None:
    rig = every_type()
    model, data = loaded(write_mjcf(tmp_path / "model", rig))
    rng = np.random.default_rng(0)
    for _ in range(30):
        angles = {name: rng.uniform(*rig.limits[name]) for name in rig.angle_names}
        posed(model, data, angles)
        for bone, transform in rig.bone_transforms(angles).items():
            body = data.body(bone)
            np.testing.assert_allclose(body.xmat.reshape(3, 3), transform.rotation, atol=1e-9)
            np.testing.assert_allclose(1e3 * body.xpos, transform.translation, atol=1e-7)


def test_joints_have_the_names_and_limits_of_angles(tmp_path: Path) -> None:
    rig = every_type()
    model, _ = loaded(write_mjcf(tmp_path / "model", rig))
    found = {model.joint(i).name: model.joint(i).range for i in range(model.njnt)}
    assert found.keys() == set(rig.angle_names) and model.jnt_limited.all()
    for name, limits in rig.limits.items():
        np.testing.assert_allclose(found[name], limits, atol=1e-9)


def with_a_ring(rig: Rig) -> Rig:
    """The rig with a root bone that is not convex."""
    mesh = trimesh.creation.annulus(r_min=4.0, r_max=6.0, height=3.0)
    ring = Surface(np.asarray(mesh.vertices) + [2.0, 1, 0], np.asarray(mesh.faces))
    return replace(rig, surfaces=rig.surfaces | {"root": ring})


def test_meshes_are_the_bones_in_metres(tmp_path: Path) -> None:
    rig = with_a_ring(every_type())
    model, data = loaded(write_mjcf(tmp_path / "model", rig))
    posed(model, data, {})
    for bone, surface in rig.surfaces.items():
        mesh = trimesh.Trimesh(surface.vertices, surface.triangles)
        assert model.body(bone).mass[0] == pytest.approx(1e-9 * mesh.volume * BONE_DENSITY, rel=1e-4)
        np.testing.assert_allclose(1e3 * data.body(bone).xipos, mesh.center_mass, atol=1e-3)


def test_it_can_be_simulated(tmp_path: Path) -> None:
    model, data = loaded(write_mjcf(tmp_path / "model", every_type()))
    data.qvel[:] = 1.0
    for _ in range(500):
        mujoco.mj_step(model, data)
    assert data.time == pytest.approx(500 * model.opt.timestep) and np.isfinite(data.qpos).all()
    assert not [warning for warning in data.warning if warning.number]


def test_residuals_are_measured() -> None:
    """A hinge that shifts its child by 2 mm a rad along y: all bones but the root move by that."""
    assert residual_motion(every_type()) == (0, 0)
    shift = np.array([[0.0, 2.0, 0.0], [0, 0, 0]])
    mean, largest = residual_motion(every_type(shift))
    most = 2 * np.radians(60)
    assert 0.95 * most < largest <= most + 1e-9
    middle = 2 * np.radians((30**2 + 60**2) / 2 / 90)  # of |angle| between -30 and 60 degrees
    assert mean == pytest.approx(middle * 5 / 6, rel=0.15)


def manufactured(kind: str) -> tuple[Tendon, Rig]:
    """The manufactured finger's tendon, and its bones with hinges as a rig."""
    surfaces, joints = bone_surfaces(), []
    if kind == "flexor":
        tendon = flexor(EXAMPLES)
    else:
        rest = rest_tendon()
        rods = {name: true_rod(rest, *angles) for name, angles in EXAMPLES.items()}
        poses = {name: pose(*angles) for name, angles in EXAMPLES.items()}
        tendon = build_tendon("extensor", rest, RADIUS, surfaces, RegisteredRods(rods, poses, PARENTS))
    for bone in ("middle", "distal"):
        centre, axes = np.array([JOINTS[bone], 0, 0]), Axes(np.array([[0.0, 1, 0]]), (0,))
        fit = JointFit(axes, centre, no_residual(1), no_residual(1), np.zeros((0, 1)))
        joints.append(RigJoint(bone, PARENTS[bone], bone, (bone,), LIMITS, fit))
    return tendon, Rig("base", tuple(joints), surfaces, {})


@pytest.fixture(scope="module", params=["extensor", "flexor"])
def with_tendon(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory):
    tendon, rig = manufactured(request.param)
    grid = [(a, b) for a in np.radians([-10, 20, 50, 80]) for b in np.radians([-10, 20, 50])]
    poses = [pose(0, 0), *(pose(*angles) for angles in grid)]
    path = bone_path(tendon, [tendon.solve(bones).x for bones in poses], poses)
    model, data = loaded(write_mjcf(tmp_path_factory.mktemp("mjcf") / "model", rig, [path]))
    return tendon, rig, path, model, data


def length_of_rod(tendon: Tendon, path: BonePath, bones: dict[str, RigidTransform]) -> float:
    return path.length_along(tendon.solve(bones).x, bones)


def test_the_jacobian_is_the_difference_of_the_paths_length(with_tendon) -> None:
    """Independent of MuJoCo: the path's points, carried by the rig, at angles to either side."""
    tendon, rig, path, model, data = with_tendon
    rng, step = np.random.default_rng(1), 1e-5
    for _ in range(10):
        angles = {name: rng.uniform(*rig.limits[name]) for name in rig.angle_names}
        posed(model, data, angles)
        assert 1e3 * data.ten_length[0] == pytest.approx(path.length(rig.bone_transforms(angles)), abs=1e-6)
        found = jacobian(model, data, tendon.name)
        for name in rig.angle_names:
            sides = [
                path.length(rig.bone_transforms(angles | {name: angles[name] + s})) for s in (step, -step)
            ]
            assert found[name] == pytest.approx((sides[0] - sides[1]) / (2 * step), abs=1e-5)


def test_moment_arms_are_those_of_the_rods(with_tendon) -> None:
    """Of rods that slide through all hooks, in poses between those of which the path was found.

    An extensor lies on a circle of 7 mm about each hinge, so that its moment arm is known, too: where a
    line cuts the corner, the arm is smaller.
    """
    tendon, rig, path, model, data = with_tendon
    step, lengthening = np.radians(15), tendon.name == "extensor"
    for angles in (
        {"middle": 0.35, "distal": 0.2},
        {"middle": 0.9, "distal": 0.2},
        {"middle": 0.4, "distal": 0.7},
    ):
        posed(model, data, angles)
        found = jacobian(model, data, tendon.name)
        for name in rig.angle_names:
            sides = [
                length_of_rod(tendon, path, pose(**(angles | {name: angles[name] + s})))
                for s in (step, -step)
            ]
            of_rods = (sides[0] - sides[1]) / (2 * step)
            assert (of_rods > 0) == (found[name] > 0) == lengthening
            assert abs(found[name]) == pytest.approx(abs(of_rods), rel=0.25)
            if lengthening:
                assert of_rods == pytest.approx(DEPTH, rel=0.15)


def test_the_stage_leaves_folded_rods_out_and_states_the_differences(
    with_tendon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tendon, rig, _, _, _ = with_tendon
    rig.save(tmp_path / "rig.h5")
    tendon.save(tmp_path / "tendon.h5")
    made = []
    for number, values in enumerate(EXAMPLES.values()):
        bones = pose(*values)
        shapes = TendonLayer([tendon]).solve(Frame("", {}, bones), {})
        line = shapes[f"{tendon.name}_centreline"]
        folded = {"compression": 0.5 if number == 3 else 0.0}
        shapes[f"{tendon.name}_centreline"] = replace(line, figures=folded)
        made.append(
            (
                Frame(f"f{number}", dict(zip(("middle", "distal"), values, strict=True)), bones),
                {"tendons": shapes},
            )
        )
    write_frames(tmp_path / "frames-0.h5", made)
    outputs = export_skeleton.Outputs(tmp_path / "skeleton", tmp_path / "figures.json")
    inputs = export_skeleton.Inputs(tmp_path / "rig.h5", [tmp_path / "frames-0.h5"], [tmp_path / "tendon.h5"])
    exported: list[str] = []
    export = trimesh.Trimesh.export
    monkeypatch.setattr(
        trimesh.Trimesh,
        "export",
        lambda mesh, path, **more: (exported.append(path.name), export(mesh, path, **more)),
    )
    export_skeleton.export_skeleton(inputs, outputs)
    assert len(exported) == len(set(exported)) == len(rig.bones)  # both models have the same files
    found = metrics.read(tmp_path / "figures.json")
    assert found["residual_max"] == (0.0, "mm")
    assert (found[f"{tendon.name}_frames"][0], found[f"{tendon.name}_folded"][0]) == (3, 1)
    assert 0 < found[f"{tendon.name}_length_error_max"][0] < 1.5
    model, _ = loaded(tmp_path / "skeleton" / "skeleton.xml")
    assert model.ntendon == 1 and model.tendon(0).name == tendon.name


def test_hooks_that_would_fold_the_path_are_left_out(with_tendon) -> None:
    """The flexor's path through all hooks folds at bent joints: it is then much longer than the rod."""
    tendon, _, path, _, _ = with_tendon
    assert list(dict.fromkeys(path.bones)) == [*BONES]
    owners = [BONES[i] for i in tendon.hooks.weights.argmax(axis=1)]
    every = BonePath(
        tendon.name, RADIUS, (*owners, "base"), np.vstack([tendon.hooks.rest, tendon.rest.x[-1:]])
    )
    excess = {}
    for name, found in (("chosen", path), ("every", every)):
        bent, straight = (
            found.length(bones) - length_of_rod(tendon, found, bones)
            for bones in (pose(1.2, 0.8), pose(0, 0))
        )
        excess[name] = bent - straight
    assert abs(excess["chosen"]) < 1.5
    if tendon.name == "flexor":
        assert excess["every"] > 5
