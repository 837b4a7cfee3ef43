"""Blends of bone transforms."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.fem.bodies import box, box_surface

from handpipe.core.rigid import RigidTransform
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.skeleton.posing.skinning import blend, bone_weights, smoothed_weights

TURN = RigidTransform(Rotation.from_rotvec([0.3, 2.0, -0.7]).as_matrix(), np.array([4.0, -3.0, 9.0]))
OTHER = RigidTransform.about(np.array([1.0, 2.0, 3.0]), Rotation.from_rotvec([-2.5, 0.1, 0.2]).as_matrix())


def _bones():
    """Two bars along x, 0.5 mm apart at x = 0, 4 mm thick."""
    left = Surface(*box_surface((19.75, 4.0, 4.0), (-20.0, -2.0, -2.0)))
    right = Surface(*box_surface((19.75, 4.0, 4.0), (0.25, -2.0, -2.0)))
    return {"left": left, "right": right}


def _bent(degrees):
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    return {"left": RigidTransform.identity(), "right": RigidTransform.about(np.zeros(3), turn)}


def test_one_weight_gives_the_bones_own_transform():
    points = np.random.default_rng(0).normal(size=(20, 3)) * 30
    transforms = {"a": TURN, "b": OTHER}
    for index, transform in enumerate(transforms.values()):
        weights = np.tile(np.eye(2)[index], (20, 1))
        np.testing.assert_allclose(blend(points, weights, transforms), transform(points), atol=1e-12)


def test_equal_transforms_blend_to_themselves():
    points = np.random.default_rng(0).normal(size=(20, 3)) * 30
    weights = np.random.default_rng(1).dirichlet(np.ones(3), 20)
    moved = blend(points, weights, {"a": TURN, "b": TURN, "c": TURN})
    np.testing.assert_allclose(moved, TURN(points), atol=1e-12)


@pytest.mark.parametrize("degrees", [60.0, 150.0, 200.0])
def test_halves_of_a_hinge_blend_to_half_its_angle(degrees):
    # Half of a turn about an axis through the origin keeps each point's distance to the axis.
    points = np.random.default_rng(2).normal(size=(20, 3))
    moved = blend(points, np.full((20, 2), 0.5), _bent(degrees))
    half = degrees / 2 if degrees < 180 else degrees / 2 - 180  # the shorter way round
    np.testing.assert_allclose(moved, _bent(half)["right"](points), atol=1e-12)


def test_joints_of_a_finger_may_together_turn_by_more_than_half_a_turn():
    # Three bones on one hinge, turned by 0, 110 and 220 degrees: half-way between the last two it is 165.
    turns = [_bent(degrees)["right"] for degrees in (0.0, 110.0, 220.0)]
    points = np.random.default_rng(2).normal(size=(20, 3))
    weights = np.tile([0.02, 0.49, 0.49], (20, 1))
    moved = blend(points, weights, dict(zip("abc", turns, strict=True)))
    off = np.linalg.norm(moved - _bent(165.0)["right"](points), axis=1)
    assert off.max() < 0.1 * np.linalg.norm(points, axis=1).max()


def test_weights_sum_to_one_and_favour_the_nearest_bone():
    bones = _bones()
    points = np.random.default_rng(3).uniform([-20, -8, -8], [20, 8, 8], (200, 3))
    weights = bone_weights(points, bones)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert weights.min() > 0
    np.testing.assert_array_equal(weights[:, 1] > 0.5, points[:, 0] > 0)
    far = bone_weights(np.array([[-15.0, 1.0, 0.5]]), bones)
    assert far[0, 0] > 0.99


@pytest.mark.parametrize("degrees", [45.0, 90.0])
def test_a_bent_bar_has_no_inverted_tet(degrees):
    vertices, tets = box((40.0, 14.0, 14.0), (20, 7, 7))
    mesh = TetMesh(vertices - [20.0, 7.0, 7.0], tets)
    weights = smoothed_weights(mesh, _bones())
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert weights.min() > 0
    moved = mesh.moved(blend(mesh.vertices, weights, _bent(degrees)))
    assert moved.volumes().min() > 0
