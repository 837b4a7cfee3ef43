"""Constraints against surfaces that move."""

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box, box_surface, sphere

from handpipe.core.rigid import RigidTransform
from handpipe.fem.contact.constraints import Attachment, Contact, Sliding
from handpipe.fem.contact.one_sided import penalty
from handpipe.fem.contact.surface_contact import SurfaceContact
from handpipe.fem.contact.surface_sliding import SurfaceSliding
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.solver.equilibrium import Options, Steps, continuation
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

SIZE = (3.0, 2.0, 1.0)
VERTICES, TETS = box(SIZE, (6, 4, 2))
BODY, EVERY = Elastic(VERTICES, TETS, Material(6.0, 0.45)), sp.eye(len(VERTICES), format="csr")
LOWEST, LEFT = VERTICES[:, 2] < 1e-9, VERTICES[:, 0] < 1e-9
FINE = Options(displacement_tolerance=1e-7, force_tolerance=1e-8)


def _motion(t):
    """A turn by 40 degrees at t = 1 about an axis beside the body, with a shift."""
    angle = t * np.radians(40)
    c, s = np.cos(angle), np.sin(angle)
    turn = RigidTransform.about(np.array([0.0, -1.0, 0.0]), np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    return RigidTransform(turn.rotation, turn.translation + t * np.array([0.0, 0.0, 0.5]))


def _planes(kind):
    origins = VERTICES[LOWEST]
    normals = np.tile([0.0, 0.0, 1.0], (len(origins), 1))
    fixed = kind(EVERY[LOWEST], origins, normals, 200.0)
    return lambda t: fixed.moved(_motion(t)(origins), normals @ _motion(t).rotation.T)


def _surface(kind):
    table = Surface(*box_surface((9.0, 9.0, 1.0), (-3.0, -3.0, -1.0)))
    fixed = kind(EVERY[LOWEST], Distance(table), 200.0)

    def at(t):
        return fixed.moved(Distance(Surface(_motion(t)(table.vertices), table.triangles)))

    return at


@pytest.mark.parametrize(
    "moving", [_planes(Sliding), _planes(Contact), _surface(SurfaceContact), _surface(SurfaceSliding)]
)
def test_a_body_carried_by_a_moving_surface_is_moved_as_a_whole(moving):
    springs = Attachment(EVERY[LEFT], VERTICES[LEFT] - [0, 0, 0.05], 100.0)  # presses it onto the surface

    def potentials(t):
        return [BODY, springs.moved(_motion(t)(springs.targets)), moving(t)]

    start = continuation(lambda t: potentials(0.0), VERTICES, options=FINE).x
    carried = continuation(potentials, start, options=FINE, steps=Steps(first=0.5)).x
    np.testing.assert_allclose(carried, _motion(1.0)(start), atol=1e-5)
    assert np.abs(start - VERTICES).max() > 1e-3


def test_moved_constraints_share_their_pattern():
    at = _planes(Sliding)
    matrices = [at(t).hessian(VERTICES) for t in (0.0, 0.5)]
    assert np.shares_memory(matrices[0].indices, matrices[1].indices)


def test_a_constant_hessian_is_kept_and_belongs_to_its_planes():
    origins, up = VERTICES[LOWEST], np.tile([0.0, 0.0, 1.0], (LOWEST.sum(), 1))
    planes = Sliding(EVERY[LOWEST], origins, up, 200.0)
    kept = planes.hessian(VERTICES)
    assert planes.hessian(VERTICES + 1.0, True) is kept
    across = np.roll(up, 1, axis=1)
    moved, anew = planes.moved(origins, across), Sliding(EVERY[LOWEST], origins, across, 200.0)
    np.testing.assert_array_equal(moved.hessian(VERTICES).toarray(), anew.hessian(VERTICES).toarray())
    assert abs(moved.hessian(VERTICES) - kept).max() > 100


def test_points_slide_around_a_bone_that_turns_beneath_them():
    bone, sides = sphere(1.0, 3)
    ring = bone[np.abs(bone[:, 2]) < 0.3]
    every = sp.eye(len(ring), format="csr")
    fixed = SurfaceSliding(every, Distance(Surface(bone, sides)), 10.0)
    weak = Attachment(every, ring, 1e-3)

    def turned(t):
        vertices = bone @ _motion(t).rotation.T
        return [weak, fixed.moved(Distance(Surface(vertices, sides)))]

    found = continuation(turned, ring, options=FINE)
    final = Distance(Surface(bone @ _motion(1.0).rotation.T, sides))
    assert np.abs(final.signed(found.x)[0]).max() < 1e-4
    np.testing.assert_allclose(found.x, ring, atol=0.02)  # the surface slips away below: no friction


def test_a_point_is_felt_wherever_it_came_from():
    """What is known of a point from where it was before is never more than is true."""
    ball = Distance(Surface(*sphere(1.0, 3)))
    rng = np.random.default_rng(7)
    points = rng.uniform(-4, 4, (300, 3))
    contact = SurfaceContact(sp.eye(len(points), format="csr"), ball, 5.0, thickness=0.1)
    touching = 0
    for _ in range(40):
        points = 0.95 * points + 0.1 * rng.normal(size=points.shape)
        gaps = ball.signed(points)[0]
        assert np.isclose(contact.value(points), 5.0 * penalty(0.1 - gaps, 0.05)[0].sum(), rtol=1e-12)
        assert np.all(contact.depths(points) >= 0.1 - gaps - 1e-12)
        touching = max(touching, int((gaps < 0.1).sum()))
    assert touching > 50


@pytest.mark.parametrize("kind", [SurfaceContact, SurfaceSliding])
def test_stacked_constraints_are_the_sum_of_their_parts(kind):
    vertices, sides = sphere(1.0, 2)
    rng = np.random.default_rng(5)
    x = rng.uniform(-2.5, 2.5, (60, 3))
    every = sp.eye(len(x), format="csr")
    parts = [
        kind(every[rng.permutation(60)[:count]], Distance(Surface(vertices + shift, sides)), stiffness)
        for count, shift, stiffness in ((40, 0.0, 3.0), (0, 1.0, 2.0), (50, 0.7, 5.0))
    ]
    [one] = kind.stacked(parts)
    for y in (x, x + 0.3 * rng.normal(size=x.shape)):
        assert np.isclose(one.value(y), sum(p.value(y) for p in parts), rtol=1e-12)
        np.testing.assert_allclose(one.gradient(y), sum(p.gradient(y) for p in parts), atol=1e-12)
        expected = sum(p.hessian(y).toarray() for p in parts)
        np.testing.assert_allclose(one.hessian(y).toarray(), expected, atol=1e-12)
    step = 3.0 * rng.normal(size=x.shape)
    assert one.max_step(x, step) == min(p.max_step(x, step) for p in parts)
    assert kind.stacked([]) == []
