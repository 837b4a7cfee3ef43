"""A fold of skin closes on itself: without contact it would go through."""

import numpy as np
import pytest
from tests.fem.bodies import box

from handpipe.core.rigid import RigidTransform
from handpipe.fem.elements.materials import Material
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledBody, CoupledPose, SkinContact
from handpipe.synthetic.coupled.follow import follow

MATERIAL = {"skin": Material(10.0, 0.4)}


@pytest.fixture(scope="module")
def fold():
    """A channel of two arms, 1 mm apart; its outer sides are held as if by bones."""
    vertices, tets = box((5.0, 2.0, 4.0), (5, 2, 4))
    centres = vertices[tets].mean(axis=1)
    kept = tets[(centres[:, 2] < 1) | (centres[:, 0] < 2) | (centres[:, 0] > 3)]
    used, kept = np.unique(kept, return_inverse=True)
    mesh = TetMesh(vertices[used], kept.reshape(-1, 4))
    x = mesh.vertices
    high = x[:, 2] >= 2
    bones = {"left": np.flatnonzero(high & (x[:, 0] == 0)), "right": np.flatnonzero(high & (x[:, 0] == 5))}
    return CoupledAnatomy(mesh, np.zeros(len(mesh.tets), dtype=int), ("skin",), bones)


def _squeezed(t):
    shift = np.array([0.75 * t, 0.0, 0.0])
    return CoupledPose({"left": RigidTransform(np.eye(3), shift), "right": RigidTransform(np.eye(3), -shift)})


def _opening(body, x):
    """Mean distance in mm between the arms' inner sides at the top."""
    rest = body.rest
    left, right = ((rest[:, 0] == side) & (rest[:, 2] > 2.9) for side in (2, 3))
    return x[right, 0].mean() - x[left, 0].mean()


@pytest.mark.parametrize("order", [1, 2])
def test_a_fold_closes_without_cutting_itself(fold, order):
    free = CoupledBody(fold, MATERIAL, order=order)
    assert _opening(free, follow(free, _squeezed).x) < -0.2
    body = CoupledBody(fold, MATERIAL, order=order, contact=SkinContact(distance=0.2, stiffness=10.0))
    x = follow(body, _squeezed, steps=3).x
    assert not body.barrier.intersects(x)
    assert 0.0 < body.barrier.gap(x) < 0.2
    assert 0.0 < _opening(body, x) < 0.4
    assert np.allclose(x[body.on_bones["left"]], body.rest[body.on_bones["left"]] + [0.75, 0, 0], atol=1e-9)
