"""USD of simulated frames, read back by usd-core."""

from pathlib import Path

import numpy as np
import pytest
from tests.hand.test_export import simulated

from handpipe.hand.exports.export import surface_triangles
from handpipe.hand.exports.usd_cache import write_usd

pxr = pytest.importorskip("pxr", reason="usd-core is not installed")
from pxr import Usd, UsdGeom, UsdValidation  # noqa: E402


def faults(stage: Usd.Stage) -> list[str]:
    """What the validators of usd-core say of a stage."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    return [error.GetErrorAsString() for error in UsdValidation.ValidationContext(validators).Validate(stage)]


def test_bones_are_transforms_and_soft_bodies_are_points(tmp_path: Path):
    frames = simulated()
    write_usd(tmp_path / "hand.usdc", iter(frames), fps=12)
    assert [p.name for p in tmp_path.iterdir()] == ["hand.usdc"]
    stage = Usd.Stage.Open(str(tmp_path / "hand.usdc"))
    assert (UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)) == (0.001, "Z")
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (0, 2, 12)
    bone = UsdGeom.Xformable(stage.GetPrimAtPath("/Hand/bones/distal2"))
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/Hand/bones/distal2/mesh")).GetPointsAttr()
    muscle = UsdGeom.Mesh(stage.GetPrimAtPath("/Hand/muscles/lumbrical1"))
    assert points.GetNumTimeSamples() == 0 and muscle.GetPointsAttr().GetNumTimeSamples() == 3
    assert muscle.GetFaceVertexIndicesAttr().GetNumTimeSamples() == 0
    for time, (frame, layers) in enumerate(frames):
        matrix = np.array(bone.ComputeLocalToWorldTransform(time))
        np.testing.assert_array_equal(matrix[:3, :3].T, frame.bones["distal2"].rotation)
        np.testing.assert_array_equal(matrix[3, :3], frame.bones["distal2"].translation)
        placed = np.array(points.Get()) @ matrix[:3, :3] + matrix[3, :3]
        np.testing.assert_allclose(placed, layers["bones"]["distal2"].vertices, atol=1e-5)
        shape = layers["muscles"]["lumbrical1"]
        found = np.array(muscle.GetPointsAttr().Get(time))
        np.testing.assert_array_equal(found, shape.vertices.astype(np.float32))  # all corners are outside
        triangles = np.array(muscle.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
        np.testing.assert_array_equal(triangles, surface_triangles(shape.cells))
        box = np.array(muscle.GetExtentAttr().Get(time))
        np.testing.assert_array_equal(box, [found.min(axis=0), found.max(axis=0)])
    assert not stage.GetPrimAtPath("/Hand/tendons/flexor2")  # a line
    assert faults(stage) == []


def test_the_validators_find_a_stage_without_units(tmp_path: Path):
    """They can fail: a stage as usd-core makes it has no units, no axis and no default prim."""
    assert len(faults(Usd.Stage.CreateNew(str(tmp_path / "bare.usdc")))) >= 2


def test_no_frames_give_an_empty_hand(tmp_path: Path):
    write_usd(tmp_path / "hand.usdc", [])
    stage = Usd.Stage.Open(str(tmp_path / "hand.usdc"))
    assert [p.GetPath() for p in stage.Traverse()] == ["/Hand"]
