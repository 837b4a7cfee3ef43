"""Simpler models of the skin: their errors against known spheres, and skinning by exact motions."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core import Frame, RigidTransform, Shape, metrics
from handpipe.core.configuration import Role
from handpipe.hand import write_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.joint_tree import FittedPose
from handpipe.skeleton.posing import blend, blend_linearly
from handpipe.skeleton.rig import Rig, pivoted
from handpipe.skeleton.rig.pivots import head
from handpipe.stages.baselines.evaluate_baselines import Inputs, Outputs, evaluate_baselines
from handpipe.tissues.fat import Rigid, Skin

BALL = trimesh.creation.icosphere(subdivisions=4, radius=10.0)
HOME = RigidTransform(Rotation.from_rotvec([0.3, -1.0, 0.4]).as_matrix(), np.array([30.0, -5.0, 12.0]))
RADII = {  # mm of each model's skin, by pose; scans have 10 mm
    "fist": {"m0": 10.1, "m1": 10.4, "m2": 10.5, "m3": 10.05, "linear": 11.0},
    "half": {"m0": 10.1, "m1": 10.6, "m2": 9.5, "m3": 10.2, "linear": 11.0},
    "hook": {"m0": 9.9, "m1": 10.6, "m2": 9.5, "m3": 9.6, "linear": 11.0},
}
ROLES = {"fist": Role.example, "half": Role.heldout, "hook": Role.heldout}
KINDS = {"skins": ["m0"], "passive": ["m1", "m2"], "baselines": ["m3", "linear"]}  # models by file


def ball(radius: float) -> Surface:
    return Surface(BALL.vertices * (radius / 10.0), BALL.faces)


def settled(radius: float) -> dict[str, float]:
    """Figures of a skin's contact; its overlap is the distance of a radius from 20."""
    contact = {"contact_renewals": 3.0, "contact_motion": 0.1, "contact_unsettled": 1.0}
    return {**contact, "skin_overlap": 20.0 - radius}


def evaluated(folder: Path) -> tuple[dict[str, float], list[dict]]:
    """Figures and rows of the models of `RADII`; scans lie in another frame than the simulation."""
    rig = Rig("a", (), {"a": ball(3.0)}, {pose: FittedPose(HOME, {}, frozenset()) for pose in RADII})
    rig.save(folder / "rig.h5")
    Skin(ball(10.0), {"cut_end": Rigid("a", np.array([0, 1]))}).save(folder / "skin.h5", [])
    files: dict[str, list[Path]] = {"scans": [], **{kind: [] for kind in KINDS}}
    for pose, radii in RADII.items():
        frame = Frame(pose, {}, {"a": RigidTransform.identity()})
        shapes = {
            m: {"skin": Shape(ball(10).vertices, ball(r).vertices, BALL.faces, {}, settled(r))}
            for m, r in radii.items()
        }
        for kind, models in KINDS.items():
            files[kind].append(folder / f"{pose}-{kind}.h5")
            write_frames(files[kind][-1], [(frame, {m: shapes[m] for m in models})])
        files["scans"].append(folder / f"{pose}.ply")
        trimesh.Trimesh(HOME(ball(10.0).vertices), BALL.faces, process=False).export(files["scans"][-1])
    inputs = Inputs(rig=folder / "rig.h5", skin=folder / "skin.h5", truth=(), **files)
    outputs = Outputs(metrics=folder / "baselines.json", table=folder / "table.json")
    poses = {pose: SimpleNamespace(role=role) for pose, role in ROLES.items()}
    evaluate_baselines(inputs, outputs, SimpleNamespace(poses=poses, truth=None), [])
    figures = {name: value for name, (value, _) in metrics.read(outputs.metrics).items()}
    return figures, json.loads(outputs.table.read_text())


def test_errors_are_the_differences_of_the_radii(tmp_path: Path):
    figures, rows = evaluated(tmp_path)
    facets = 0.02  # mm that a triangle of the balls lies below its corners
    assert figures["m0_example_error_mean"] == pytest.approx(0.1, abs=facets)
    assert figures["m3_heldout_error_mean"] == pytest.approx(0.3, abs=facets)
    assert figures["m3_heldout_error_max"] == pytest.approx(0.4, abs=facets)
    assert figures["linear_heldout_error_mean"] == pytest.approx(1.0, abs=facets)
    assert figures["m0_over_best_heldout"] == pytest.approx(
        100 * 0.1 / 0.3, rel=0.1
    )  # m3 is the best of the others
    assert {(row["model"], row["role"]) for row in rows} == {
        (model, role) for model in RADII["fist"] for role in ("example", "heldout")
    }
    assert not any("true" in name for name in figures)
    assert figures["m2_overlap_max"] == pytest.approx(10.5)  # of the worst pose
    assert figures["m3_contact_unsettled"] == 3 and "linear_overlap_max" not in figures


def test_pivots_lie_in_the_heads_of_the_parents_and_bones_keep_their_rotations():
    """A bar with a ball at its end: a sphere's centre is known."""
    shaft = trimesh.creation.cylinder(radius=3.0, height=40.0, sections=24).subdivide()
    at_end = trimesh.creation.icosphere(subdivisions=3, radius=5.0).apply_translation([0, 0, 20.0])
    parent = Surface(
        np.concatenate([shaft.vertices, at_end.vertices]),
        np.concatenate([shaft.faces, at_end.faces + len(shaft.vertices)]),
    )
    child = ball(4.0).moved(ball(4.0).vertices + [0.0, 0.0, 40.0])
    surfaces = {"parent": parent, "child": child}
    centre = head(surfaces, "parent", "child")
    np.testing.assert_allclose(centre, [0.0, 0.0, 20.0], atol=1e-6)

    rig = Rig("parent", (SimpleNamespace(parent="parent", child="child"),), surfaces, {})
    turn = RigidTransform.about(np.array([1.0, 2.0, 22.0]), Rotation.from_rotvec([1.2, 0.0, 0.1]).as_matrix())
    bones = {"parent": HOME, "child": HOME @ turn}
    found = pivoted(rig, bones)
    assert found["parent"] is HOME
    np.testing.assert_allclose(found["child"].rotation, bones["child"].rotation)
    np.testing.assert_allclose(found["child"](centre[None]), HOME(centre[None]))


def test_a_linear_blend_of_half_a_turn_collapses_onto_the_axis_and_a_dual_quaternions_does_not():
    points = np.array([[3.0, 0.0, 1.0], [0.0, 4.0, -2.0]])
    half = np.full((2, 2), 0.5)
    turns = {
        "still": RigidTransform.identity(),
        "turned": RigidTransform(Rotation.from_rotvec([0, 0, np.pi - 1e-9]).as_matrix(), np.zeros(3)),
    }
    np.testing.assert_allclose(blend_linearly(points, half, turns), points * [0, 0, 1], atol=1e-7)
    quarter = Rotation.from_rotvec([0, 0, np.pi / 2]).apply(points)
    np.testing.assert_allclose(blend(points, half, turns), quarter, atol=1e-7)


def test_a_linear_blend_of_one_motion_is_that_motion():
    points = np.random.default_rng(0).normal(size=(20, 3)) * 30
    weights = np.random.default_rng(1).dirichlet(np.ones(2), 20)
    np.testing.assert_allclose(blend_linearly(points, weights, {"a": HOME, "b": HOME}), HOME(points))
