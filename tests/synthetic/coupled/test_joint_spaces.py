"""Two rods that turn about their common ball: what glides, and a sleeve of tissue that follows them far."""

import numpy as np
import pytest
from benchmarks.truth import toy
from scipy.spatial.transform import Rotation

from handpipe.core.rigid import RigidTransform
from handpipe.fem.solver.equilibrium import Options
from handpipe.mesh.contact.gliding_surfaces import gliding
from handpipe.mesh.surfaces.surface import Surface
from handpipe.synthetic.continuum.surfaces import bone_faces
from handpipe.synthetic.coupled.coupled_body import CoupledBody
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.joint_spaces import opened
from handpipe.synthetic.coupled.validation import patch_test

BENT = np.radians(80.0)


@pytest.fixture(scope="module")
def closed():
    return toy.finger(5.0)


def _surfaces(anatomy):
    mesh = anatomy.mesh
    found = {n: Surface(mesh.vertices, bone_faces(mesh, on)).flipped() for n, on in anatomy.bones.items()}
    return {name: surface.compact() for name, surface in found.items()}


def _passed(anatomy, angles, reach=3.0):
    positions = [toy.hinge(angle).bones for angle in angles]
    surfaces, vertices = _surfaces(anatomy), anatomy.mesh.vertices
    return gliding(vertices, anatomy.bones, surfaces, [("proximal", "distal")], positions, reach)


def test_what_glides_lies_where_the_other_bone_comes(closed):
    """The gap is 2 mm on the axis and the bones are balls there: by their law of cosines."""
    vertices, on = closed.mesh.vertices, closed.bones["proximal"]
    for angle in (0.0, BENT):
        passed = _passed(closed, [angle])[on]
        turn = Rotation.from_rotvec([0, angle, 0])
        centre = toy.CENTRE + turn.apply([2 * toy.BONE_RADIUS + toy.GAP, 0, 0])
        distance = np.linalg.norm(vertices[on] - centre, axis=1) - toy.BONE_RADIUS
        assert passed[distance < 2.7].all() and not passed[distance > 3.3].any()
        assert passed.any()


def test_opened_keeps_all_but_what_spans_the_joint(closed):
    body = opened(closed, _passed(closed, [0.0, BENT]))
    between = [np.isin(closed.mesh.tets, on).any(axis=1) for on in closed.bones.values()]
    lost = closed.mesh.volumes().sum() - body.mesh.volumes().sum()
    assert lost == pytest.approx(closed.mesh.volumes()[between[0] & between[1]].sum(), rel=1e-9)
    assert 0 < lost < 0.05 * closed.mesh.volumes().sum()
    for name, along in body.fibres.items():
        assert len(along) == len(body.tets_of(name))


def test_the_patch_test_holds_with_a_cavity(closed):
    body = CoupledBody(opened(closed, _passed(closed, [0.0, BENT])), toy.MATERIALS, order=1)
    assert patch_test(body) < 1e-8


def test_an_open_joint_bends_where_a_filled_one_is_torn(closed):
    options = Options(name="toy", max_iterations=60, untangle=False)
    body = CoupledBody(opened(closed, _passed(closed, np.linspace(0, BENT, 5))), toy.MATERIALS, order=1)
    found = follow(body, lambda t: toy.hinge(t * BENT, 0.2), steps=8, options=options)
    assert body.inverted(found.x) == 0
    bone = body.on_bones["distal"]
    turned = RigidTransform.about(toy.CENTRE, Rotation.from_rotvec([0, BENT, 0]).as_matrix())
    np.testing.assert_allclose(found.x[bone], turned(body.rest[bone]), atol=1e-9)
