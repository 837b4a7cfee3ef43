"""A block in the cavity of another slides without force, keeps its volume, and leaves no void behind."""

import numpy as np
import pytest
from tests.fem.bodies import box

from handpipe.core.rigid import RigidTransform
from handpipe.fem.elements.materials import Material
from handpipe.fem.solver.equilibrium import Options
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy, CoupledPose
from handpipe.synthetic.sliding.sliding_body import Interfaces, SlidingBody, follow

MATERIALS = {"fat": Material(3.0, 0.45), "muscle": Material(6.0, 0.45)}
SKIN = Material(20.0, 0.45)
CAVITY = np.array([[2.0, 2.0, 2.0], [10.0, 6.0, 6.0]])  # mm, corners
OPTIONS = Options(displacement_tolerance=1e-4, force_tolerance=1e-4, max_iterations=200, untangle=False)
SLID = 1.5  # mm


@pytest.fixture(scope="module")
def blocks():
    """Fat of 12 x 8 x 8 mm around a cavity of 8 x 4 x 4 mm, and a block in it, 3 mm shorter, 0.2 mm apart.

    One layer of the fat's outside moves with one bone, the block with another: without friction the block
    feels the wall's pressure alone.
    """
    vertices, tets = box((12.0, 8.0, 8.0), (6, 4, 4))
    centres = vertices[tets].mean(axis=1)
    inside = ((centres > CAVITY[0]) & (centres < CAVITY[1])).all(axis=1)
    used, fat = np.unique(tets[~inside], return_inverse=True)
    small, cells = box((5.0, 3.6, 3.6), (3, 2, 2))
    small = small + [2.2, 2.2, 2.2]
    points = np.concatenate([vertices[used], small])
    mesh = TetMesh(points, np.concatenate([fat.reshape(-1, 4), cells + len(used)]))
    labels = np.repeat([0, 1], [len(tets) - inside.sum(), len(cells)])
    rim = np.flatnonzero((points[: len(used)] == [0, 0, 0]).any(axis=1))
    bones = {"outer": rim, "inner": len(used) + np.arange(len(small))}
    along = np.tile([1.0, 0.0, 0.0], (len(cells), 1))
    return CoupledAnatomy(mesh, labels, ("fat", "muscle"), bones, {"muscle": along})


def _body(blocks, suction, order=1):
    interfaces = Interfaces(distance=0.3, stiffness=10.0, suction=suction, skin=SKIN, thickness=0.5)
    return SlidingBody(blocks, {}, MATERIALS, interfaces, order=order)


def _moved(*shift):
    def at(t):
        inner = RigidTransform(np.eye(3), t * np.array(shift, dtype=float))
        return CoupledPose({"outer": RigidTransform.identity(), "inner": inner})

    return at


def _force(body, pose, x):
    """Force (3,) in mN that moves the block."""
    gradient = sum(p.gradient(x) for p in body.energies(pose))
    return gradient[body.on_bones["inner"]].sum(axis=0)


def _behind(body, x):
    """Mean distance in mm of the block's side of least y from the wall that it leaves."""
    rest = body.rest
    wall = (rest[:, 1] == CAVITY[0, 1]) & (np.abs(rest[:, 0] - 5) < 1.1) & (np.abs(rest[:, 2] - 4) < 0.1)
    return 2.2 + 0.6 - x[wall, 1].mean()


@pytest.mark.parametrize("order", [1, 2])
def test_a_block_slides_along_its_cavity_without_force(blocks, order):
    body, motion = _body(blocks, 0.0, order), _moved(1.0, 0, 0)
    found = follow(body, motion, steps=1, options=OPTIONS)
    assert found.record.converged
    assert body.barrier.gap(found.x) > 0
    along, *_ = _force(body, motion(1.0), found.x)
    stuck = 1.03 * 1.0 / 2.0 * 4 * 5.0 * 3.6  # mN: the shear of 2 mm of fat on the block's four sides
    assert abs(along) < 0.01 * stuck


def test_suction_makes_the_wall_follow_a_block_that_leaves_it(blocks):
    motion = _moved(0, 0.6, 0)
    bodies = {suction: _body(blocks, suction) for suction in (0.0, 8.0)}
    found = {s: follow(body, motion, steps=2, options=OPTIONS).x for s, body in bodies.items()}
    assert _behind(bodies[0.0], found[0.0]) > 0.6
    assert 0 < _behind(bodies[8.0], found[8.0]) < 0.3
    assert bodies[8.0].void.volume(found[8.0]) < bodies[0.0].void.volume(found[0.0])
    assert bodies[8.0].barrier.gap(found[8.0]) > 0
    assert bodies[8.0].inverted(found[8.0]) == 0
