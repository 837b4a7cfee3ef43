"""The solver: recovery from bad starts, contact, continuation, and honest failure."""

import logging

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box, box_surface, sphere

from handpipe.errors import ConvergenceError, InputError
from handpipe.fem import equilibrium
from handpipe.fem.barrier import Barrier
from handpipe.fem.cloth import Membrane
from handpipe.fem.constraints import Attachment, Contact, SurfaceContact
from handpipe.fem.elastic import Elastic
from handpipe.fem.equilibrium import Options, continuation, solve
from handpipe.fem.materials import Material
from handpipe.fem.pull import Pull
from handpipe.mesh.distance import Distance
from handpipe.mesh.surface import Surface

SIZE = (4.0, 1.0, 1.0)
VERTICES, TETS = box(SIZE, (8, 2, 2))
LEFT, RIGHT = VERTICES[:, 0] < 1e-9, VERTICES[:, 0] > SIZE[0] - 1e-9
SOFT = Material(6.0, 0.45)


@pytest.mark.parametrize(
    ("material", "scatter"), [(Material(6.0, 0.3), 0.6), (Material(6.0, 0.48, "stvk"), 0.2), (SOFT, 0.1)]
)
def test_scrambled_vertices_find_the_rest_shape(material, scatter):
    start = VERTICES + scatter * np.random.default_rng(0).normal(size=VERTICES.shape)
    start[LEFT] = VERTICES[LEFT]
    elastic = Elastic(VERTICES, TETS, material)
    assert np.linalg.det(elastic.deformation_gradients(start)).min() < 0
    found = solve([elastic], start, fixed=np.repeat(LEFT, 3))
    np.testing.assert_allclose(found.x, VERTICES, atol=1e-5)


def test_springs_carry_exactly_the_load():
    points = sp.eye(len(VERTICES), format="csr")
    load = np.array([0.0, 0.0, -0.02])
    forces = np.tile(load, (int(RIGHT.sum()), 1))
    springs = Attachment(points[LEFT], VERTICES[LEFT], 1e3)
    found = solve([Elastic(VERTICES, TETS, SOFT), springs, Pull(points[RIGHT], forces)], VERTICES)
    np.testing.assert_allclose(springs.gradient(found.x).sum(axis=0), forces.sum(axis=0), atol=1e-6)
    assert found.record.residuals[-1] < 1e-3 * np.linalg.norm(load)


def _bend(t):
    """The right end turned by 120 degrees and moved to where a circular arc would have it."""
    angle = max(t * 2 * np.pi / 3, 1e-9)
    radius = SIZE[0] / angle
    x = VERTICES.copy()
    offset = VERTICES[RIGHT] - [SIZE[0], 0.5, 0.5]
    c, s = np.cos(angle), np.sin(angle)
    turned = offset @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    x[RIGHT] = turned + [radius * s, 0.5 + radius * (1 - c), 0.5]
    return x


def test_continuation_bends_a_bar_and_does_not_depend_on_the_steps():
    elastic = Elastic(VERTICES, TETS, SOFT)
    held = np.repeat(LEFT | RIGHT, 3)
    shapes = [
        continuation(lambda t: [elastic], VERTICES, fixed=held, prescribed=_bend, first_step=step).x
        for step in (0.5, 0.2)
    ]
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-4)
    np.testing.assert_allclose(shapes[0][RIGHT], _bend(1.0)[RIGHT], atol=1e-12)
    assert np.linalg.det(elastic.deformation_gradients(shapes[0])).min() > 0
    interior = elastic.gradient(shapes[0])[~(LEFT | RIGHT)]
    assert np.abs(interior).max() < 1e-4 * np.abs(elastic.gradient(shapes[0])).max()


def test_conjugate_gradients_on_a_stale_factor_reach_the_same_shape(monkeypatch):
    elastic, held = Elastic(VERTICES, TETS, SOFT), np.repeat(LEFT | RIGHT, 3)
    direct = solve([elastic], _bend(0.2), fixed=held)
    monkeypatch.setattr(equilibrium, "CG_LEAST_UNKNOWNS", 0)
    monkeypatch.setattr(equilibrium, "CG_ITERATIONS_PER_FACTORISATION", 1e5)
    stale = solve([elastic], _bend(0.2), fixed=held)
    assert stale.record.cg_iterations > 0
    assert stale.record.factorisations < direct.record.factorisations
    np.testing.assert_allclose(stale.x, direct.x, atol=1e-5)


@pytest.mark.parametrize("elongation", [1.0, 1.6])  # the longer one slips off if a step passes the surface
def test_shrunk_cloth_lies_on_the_sphere_inside_it(elongation):
    vertices, triangles = sphere(6.0, 2)
    vertices = vertices * [elongation, 1.0, 1.0]
    inner = Distance(Surface(*sphere(5.0, 4)))
    cloth = Membrane(vertices, triangles, Material(0.1, 0.48), thickness=1.0, scale=0.4)
    everywhere = sp.eye(len(vertices), format="csr")
    contact = SurfaceContact(everywhere, inner, 100.0, onset=0.01)
    found = solve([cloth, contact], vertices)
    distances = inner.signed(found.x)[0]
    assert np.abs(distances).max() < 0.05
    assert cloth.stretches(found.x).min() > 1.0


def test_contact_planes_push_only_outwards():
    points = sp.eye(len(VERTICES), format="csr")
    lowest = VERTICES[:, 2] < 1e-9
    origins = np.zeros((int(lowest.sum()), 3))
    floor = Contact(points[lowest], origins, np.tile([0.0, 0.0, 1.0], (len(origins), 1)), 50.0, onset=0.01)
    above, below = VERTICES + [0, 0, 0.1], VERTICES - [0, 0, 0.1]
    assert floor.value(above) == 0.0 and not floor.gradient(above).any()
    assert floor.value(below) > 0 and (floor.gradient(below)[lowest, 2] < 0).all()


def test_barrier_stops_interpenetration():
    block, tets = box((1.0, 1.0, 1.0), (3, 3, 3))
    x = block + [0, 0, 0.3]
    table = box_surface((3.0, 3.0, 1.0), (-1.0, -1.0, -1.0))
    from handpipe.mesh.tetrahedra import TetMesh

    faces = TetMesh(block, tets).boundary_faces()[0]
    every = sp.eye(len(block), format="csr")
    pull = Pull(every, np.tile([0.0, 0.0, -0.1], (len(block), 1)))
    barrier = Barrier(every, faces, x, 0.1, 1.0, obstacle=table, self_contact=False)
    held = Attachment(every, x, 1e-3)
    found = solve([Elastic(block, tets, SOFT), pull, barrier, held], x)
    lowest = found.x[:, 2].min()
    assert 0 < lowest < 0.1
    assert barrier.gap(found.x) > 0
    with pytest.raises(InputError, match="intersect"):
        Barrier(every, faces, x - [0, 0, 0.5], 0.1, 1.0, obstacle=table)


def test_failures_say_why_and_partial_results_are_asked_for(caplog):
    elastic, held = Elastic(VERTICES, TETS, SOFT), np.repeat(LEFT | RIGHT, 3)
    hasty = Options(max_iterations=1, name="bar")
    with pytest.raises(ConvergenceError, match="bar did not converge: 1 iterations"):
        solve([elastic], _bend(0.5), fixed=held, options=hasty)
    partial = solve([elastic], _bend(0.5), fixed=held, options=Options(max_iterations=1, allow_partial=True))
    assert not partial.record.converged
    with caplog.at_level(logging.INFO, "handpipe.fem"):
        solve([elastic], _bend(0.1), fixed=held)
    assert "converged" in caplog.text
