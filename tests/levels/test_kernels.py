"""Compiled loops give what plain formulas give: skinning, dual quaternions, the rig's motions."""

import sys
from pathlib import Path

import numpy as np
import pytest

from handpipe.core.rigid import RigidTransform
from handpipe.levels import kernels
from handpipe.levels.fast_skeleton import FastSkeleton
from handpipe.skeleton.posing import blend

sys.path.insert(0, str(Path(__file__).parents[1] / "skeleton"))
import five_fingers


def test_the_rigs_motions_with_residuals_and_two_axes() -> None:
    made = five_fingers.rig()
    fast, rng = FastSkeleton.of(made), np.random.default_rng(0)
    for _ in range(5):
        angles = {name: rng.uniform(*(1.2 * np.array(made.limits[name]))) for name in made.angle_names}
        found = fast.motions(np.array([angles[name] for name in made.angle_names]))
        for motion, bone in zip(found, made.bones, strict=True):
            expected = made.bone_transforms(angles)[bone]
            assert motion[:, :3] == pytest.approx(expected.rotation, abs=1e-12)
            assert motion[:, 3] == pytest.approx(expected.translation, abs=1e-9)


@pytest.fixture
def moved():
    """Random points, four weights each, and six motions with turns beyond half a turn."""
    rng = np.random.default_rng(2)
    turns = [RigidTransform.about(rng.normal(size=3), _turn(rng.normal(size=3) * 2)) for _ in range(6)]
    joints = np.array([rng.permutation(6)[:4] for _ in range(50)])
    weights = -np.sort(-rng.dirichlet(np.ones(4), 50), axis=1)
    return rng.normal(size=(50, 3)) * 10, joints, weights, turns


def _turn(vector):
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix()


def single(values):
    return np.ascontiguousarray(values, np.float32)


def test_linear_blends(moved) -> None:
    points, joints, weights, turns = moved
    expected = [sum(w * turns[j](p[None])[0] for j, w in zip(js, ws, strict=True))
                for p, js, ws in zip(points, joints, weights, strict=True)]  # fmt: skip
    given = np.stack([np.column_stack([t.rotation, t.translation]) for t in turns])
    out = np.zeros((50, 3), np.float32)
    kernels.skin(single(points), joints.astype(np.int32), single(weights), single(given), out)
    assert out == pytest.approx(np.array(expected), abs=1e-4)


def test_dual_quaternions_are_those_of_the_skeleton(moved) -> None:
    points, joints, weights, turns = moved
    dense = np.zeros((50, 6))
    np.put_along_axis(dense, joints, weights, axis=1)
    expected = blend(points, dense, {str(i): t for i, t in enumerate(turns)})
    given = np.stack([np.column_stack([t.rotation, t.translation]) for t in turns])
    duals, out = np.zeros((6, 8)), np.zeros((50, 3), np.float32)
    kernels.dual_quaternions(given, duals)
    kernels.skin_dual(
        single(points), joints.astype(np.int32), single(weights), single(duals), np.arange(50), out
    )
    assert out == pytest.approx(expected, abs=1e-3)
