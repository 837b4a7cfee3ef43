"""The coupled body on a coarse toy finger: conforming, exact where it can be, the same from any start."""

import numpy as np
import pytest
from benchmarks.truth import toy

from handpipe.core.errors import InputError
from handpipe.fem.solver.equilibrium import Options
from handpipe.mesh.tets.tetrahedra import FACES
from handpipe.synthetic.coupled.coupled_body import CoupledBody, CoupledPose, SkinContact
from handpipe.synthetic.coupled.follow import follow
from handpipe.synthetic.coupled.validation import (
    difference,
    node_volumes,
    observed_order,
    order_without_reference,
    patch_test,
    solved_from,
    start_difference,
    volume_changes,
)

EDGE = 6.5
ANGLE = np.radians(40.0)


@pytest.fixture(scope="module")
def anatomy():
    return toy.finger(EDGE)


@pytest.fixture(scope="module")
def body(anatomy):
    return CoupledBody(anatomy, toy.MATERIALS)


@pytest.fixture(scope="module")
def posed(body):
    return follow(body, lambda t: toy.hinge(ANGLE * t)).x


def test_the_mesh_conforms_and_is_fit(anatomy):
    faces = np.sort(anatomy.mesh.tets[:, FACES].reshape(-1, 3), axis=1)
    _, counts = np.unique(faces, axis=0, return_counts=True)
    assert counts.max() == 2
    assert anatomy.mesh.smallest_dihedral() > 5.0
    assert set(np.unique(anatomy.labels)) == {0, 1, 2}
    # Nothing but the skin, the bones and nothing else is open to the outside.
    used = np.unique(anatomy.mesh.boundary_faces()[0])
    on_bones = np.concatenate(list(anatomy.bones.values()))
    rest = np.setdiff1d(used, on_bones)
    along = np.clip(anatomy.mesh.vertices[rest, 0], toy.SKIN[0][0], toy.SKIN[1][0])
    radius = np.linalg.norm(anatomy.mesh.vertices[rest] - along[:, None] * [1, 0, 0], axis=1)
    assert np.all(np.abs(radius - toy.SKIN_RADIUS) < 0.3)


def test_nodes_on_bones_are_on_their_faces(body, anatomy):
    fine = anatomy.refined().mesh.boundary_faces()[0]
    on_bones = np.concatenate(list(body.on_bones.values()))
    assert len(np.unique(on_bones)) == len(on_bones)
    assert np.array_equal(np.unique(fine), np.union1d(on_bones, np.unique(body.skin_faces)))
    assert len(np.intersect1d(on_bones, np.unique(body.skin_faces))) == 0


@pytest.mark.parametrize("order", [1, 2])
def test_patch_test_is_exact(anatomy, order):
    assert patch_test(CoupledBody(anatomy, toy.MATERIALS, order=order)) < 1e-8


def test_rest_is_an_equilibrium(body):
    forces = sum(p.gradient(body.rest) for p in body.potentials(toy.hinge(0.0)))
    assert np.abs(forces).max() < 1e-9


def test_bones_carry_their_nodes_and_strands_their_load(body, posed):
    pose = toy.hinge(ANGLE)
    for name, nodes in body.on_bones.items():
        assert np.allclose(posed[nodes], pose.bones[name](body.rest[nodes]), atol=1e-12)
    for name, strand in body.strands.items():
        end = body.strand_points(name)
        bone, point = ("proximal", 0) if "origin" in name else ("distal", end.shape[0] - 1)
        assert np.allclose((end @ posed)[point], pose.bones[bone]((end @ body.rest)[point]), atol=1e-9)
        assert strand.strains(posed).max() < 0.015


def test_the_muscle_contracts_and_keeps_its_volume(body, posed):
    stretch = body.fibres.stretches(posed)
    assert np.median(stretch) < 0.95
    assert abs(volume_changes(body, posed)["flexor"]) < 1.0
    # The straight-sided surface tells the same volume as the quadrature.
    surface = body.surface("flexor", body.rest)
    assert surface.is_closed()
    assert surface.volume() == pytest.approx(body.volume("flexor", body.rest), rel=1e-9)
    assert body.solid.volume_ratios(posed).min() > 0


def test_the_answer_does_not_depend_on_the_start(body, posed):
    away = np.radians(-15.0)
    found = start_difference(
        body,
        lambda t: toy.hinge(away * t, 0.0),
        lambda t: toy.hinge(away + (ANGLE - away) * t),
        posed,
    )
    assert found < 1e-3


def test_the_coarse_answer_is_near_the_refined_one(anatomy, body, posed):
    fine = CoupledBody(anatomy.refined(), toy.MATERIALS, order=1)
    x = solved_from(body, posed, fine, toy.hinge(ANGLE))
    assert np.allclose(node_volumes(fine).sum(), anatomy.mesh.volumes().sum(), rtol=1e-12)
    found = difference(fine, x, body, posed)  # the same nodes
    assert found["rms"][0] < 0.05 * found["displacement"][0]
    assert found["rms"][0] > 1e-3  # other elements, other answer


def test_orders_are_read_off_errors():
    assert observed_order([0.8, 0.1, 0.0125]) == pytest.approx(3.0)
    # Errors of 0.8, 0.2 and 0.05 on one side of the limit.
    assert order_without_reference(0.75, 0.15) == pytest.approx((2.0, 0.05))


def test_skin_with_contact_never_cuts_itself(anatomy):
    body = CoupledBody(anatomy, toy.MATERIALS, order=1, contact=SkinContact(distance=0.4, stiffness=5.0))
    found = follow(body, lambda t: toy.hinge(np.radians(20) * t), steps=2, options=Options(name="contact"))
    assert body.barrier is not None and not body.barrier.intersects(found.x)
    free = follow(CoupledBody(anatomy, toy.MATERIALS, order=1), lambda t: toy.hinge(np.radians(20) * t))
    assert np.allclose(found.x, free.x, atol=1e-3)  # nothing touches yet


def test_a_region_without_material_is_refused(anatomy):
    with pytest.raises(InputError, match="flexor"):
        CoupledBody(anatomy, {k: v for k, v in toy.MATERIALS.items() if k != "flexor"})


def test_a_muscle_that_is_held_pulls_on_its_tendon(body):
    def tense(t):
        return CoupledPose(toy.hinge(0.0).bones, {"flexor": 8.0 * t})

    x = follow(body, tense).x
    across = body.volume("flexor", body.rest) / (4 / 3 * toy.BELLY_AXES[0])  # mean cross-section in mm^2
    pull = sum(np.median(s.tensions(x)[-8:]) for n, s in body.strands.items() if "tendon" in n)
    assert 0.2 * 8.0 * across < pull < 8.0 * across  # mN; the muscle's own compression takes the rest
