"""Solid, active fibres and strands: derivatives against differences, objectivity."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation
from tests.fem.bodies import box

from handpipe.core.errors import InputError
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.solver.equilibrium import Options, solve
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.continuum.active import WIDTH, ActiveFibres, HillFibres
from handpipe.synthetic.continuum.crushing import CRUSHED, QuadratureCrushing
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.continuum.refinement import refine
from handpipe.synthetic.continuum.solid import Solid
from handpipe.synthetic.continuum.strands import Cable, Strands, chain
from handpipe.synthetic.continuum.voids import VoidPressure
from handpipe.synthetic.coupled.pressure import Pressure

MESH = TetMesh(*box((2.0, 1.0, 1.0), (2, 1, 1)))
RNG = np.random.default_rng(0)


def _directions(count):
    given = np.random.default_rng(3).normal(size=(count, 3))
    return given / np.linalg.norm(given, axis=1, keepdims=True)


def _potential(kind, order):
    elements = Elements.quadratic(MESH) if order == 2 else Elements.linear(MESH)
    count = len(elements.cells)
    if kind == "solid":
        return Solid(elements, Material(np.linspace(1, 6, count), 0.45)), elements.nodes
    if kind == "active":
        return ActiveFibres(elements, _directions(count), np.linspace(0, 5, count)), elements.nodes
    if kind == "hill":
        return HillFibres(elements, _directions(count), np.linspace(0, 5, count)), elements.nodes
    if kind == "void":
        walls = TetMesh(elements.nodes, (MESH if order == 1 else refine(MESH)[0]).tets).boundary()
        return VoidPressure(walls.triangles, len(elements.nodes), 7.0), elements.nodes
    if kind == "crushing":
        return QuadratureCrushing(elements, 7.0), elements.nodes
    if kind == "pressure":
        return Pressure(elements, np.linspace(-3, 5, count)), elements.nodes
    points = elements.interpolation(np.random.default_rng(2).uniform([0, 0, 0], [2, 1, 1], (6, 3)))
    if kind == "cable":
        return Cable(points, chain(6), 40.0), elements.nodes
    strands = Strands(points, chain(6), elements.nodes, 50.0, two_sided=kind == "two-sided")
    return strands, elements.nodes


def _state(nodes, name):
    noise = 0.1 * np.random.default_rng(5).normal(size=nodes.shape)
    if name == "crushed":
        return nodes * [1.1, 1.0, 0.15] + 0.05 * noise
    if name == "deformed":
        return 1.1 * nodes + noise
    if name == "flattened":
        return nodes * [1.1, 1.0, 0.0]
    return nodes * [1.0, 1.0, -0.8] + noise  # inverted


KINDS = ["solid", "active", "strands", "two-sided", "crushing", "cable", "pressure", "hill", "void"]


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", ["solid", "active", "crushing", "pressure", "hill"])
def test_the_energy_about_some_nodes_pulls_them_as_the_whole_does(kind, order):
    potential, nodes = _potential(kind, order)
    elements, x = potential.elements, _state(nodes, "crushed" if kind == "crushing" else "deformed")
    moving = np.linalg.norm(nodes - nodes[0], axis=1) < 0.6
    kept = elements.nodes_of(elements.touching(moving))
    assert 0 < moving.sum() < kept.sum() < len(nodes)
    part = potential.about(moving, kept)
    pull = potential.gradient(x)[moving]
    assert np.abs(pull).max() > 0
    np.testing.assert_allclose(part.gradient(x[kept])[moving[kept]], pull, atol=1e-12)
    rows = np.repeat(moving, 3)
    whole = potential.hessian(x)[rows][:, np.repeat(kept, 3)].toarray()
    np.testing.assert_allclose(part.hessian(x[kept])[np.repeat(moving[kept], 3)].toarray(), whole, atol=1e-11)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("state", ["deformed", "flattened", "inverted"])
def test_derivatives_agree_with_differences(kind, order, state):
    potential, nodes = _potential(kind, order)
    x = _state(nodes, "crushed" if (kind, state) == ("crushing", "deformed") else state)
    step = 1e-5
    for seed in range(3):
        d = np.random.default_rng(seed).normal(size=x.shape)
        slope = (potential.value(x + step * d) - potential.value(x - step * d)) / (2 * step)
        gradient = potential.gradient(x)
        scale = np.linalg.norm(gradient) * np.linalg.norm(d)
        assert abs(slope - (gradient * d).sum()) < 1e-7 * scale
        change = (potential.gradient(x + step * d) - potential.gradient(x - step * d)) / (2 * step)
        product = potential.hessian(x) @ d.ravel()
        assert np.linalg.norm(change.ravel() - product) < 1e-6 * np.linalg.norm(product)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_projected_hessian_is_semidefinite_and_hessian_symmetric(kind, order):
    potential, nodes = _potential(kind, order)
    x = _state(nodes, "inverted")
    plain, projected = potential.hessian(x).toarray(), potential.hessian(x, True).toarray()
    assert np.abs(plain - plain.T).max() < 1e-10 * np.abs(plain).max()
    values = np.linalg.eigvalsh(projected)
    assert values[0] >= -1e-9 * values[-1]


@pytest.mark.parametrize("kind", KINDS)
def test_energy_and_forces_turn_with_the_body(kind):
    potential, nodes = _potential(kind, 2)
    x = _state(nodes, "crushed" if kind == "crushing" else "deformed")
    turn = Rotation.from_rotvec([0.3, -1.2, 0.7]).as_matrix()
    moved = x @ turn.T + [1.0, -2.0, 3.0]
    assert np.isclose(potential.value(moved), potential.value(x), rtol=1e-12)
    assert np.allclose(potential.gradient(moved), potential.gradient(x) @ turn.T, atol=1e-10)


def test_exact_tangent_of_active_fibres_is_semidefinite():
    potential, nodes = _potential("active", 2)
    values = np.linalg.eigvalsh(potential.hessian(_state(nodes, "inverted")).toarray())
    assert values[0] > -1e-10 * values[-1]


def test_fibres_of_hills_type_pull_most_at_their_rest_length():
    elements = Elements.linear(MESH)
    along = np.tile([1.0, 0.0, 0.0], (len(elements.cells), 1))
    fibres = HillFibres(elements, along, 5.0)

    def force(stretch):
        right = elements.nodes[:, 0] == 2.0
        return fibres.gradient(elements.nodes * [stretch, 1.0, 1.0])[right, 0].sum()  # on 1 mm^2

    assert np.isclose(force(1.0), 5.0, rtol=1e-5)
    assert np.allclose([force(1 - WIDTH), force(1 + WIDTH)], 5.0 / np.e, rtol=1e-3)


def test_the_void_in_a_box_has_the_volume_of_its_walls_and_pulls_them_by_its_pressure():
    void, nodes = _potential("void", 2)
    x = nodes * [1.5, 2.0, 1.0] + [40.0, -30.0, 20.0]
    assert np.isclose(void.volume(x), 6.0, rtol=1e-12)
    right = x[:, 0] > x[:, 0].max() - 1e-9
    assert np.isclose(void.gradient(x)[right, 0].sum(), 7.0 * 2.0, rtol=1e-10)  # p times the face's area


def test_linear_elements_are_those_of_the_mechanics_package():
    material = Material(6.0, 0.48)
    ours, theirs = Solid(Elements.linear(MESH), material), Elastic(MESH.vertices, MESH.tets, material)
    x = _state(MESH.vertices, "deformed")
    assert np.isclose(ours.value(x), theirs.value(x), rtol=1e-12)
    assert np.allclose(ours.gradient(x), theirs.gradient(x), rtol=1e-10, atol=1e-10)
    difference = ours.hessian(x) - theirs.hessian(x)
    assert abs(difference).max() < 1e-10 * abs(theirs.hessian(x)).max()
    projected = ours.hessian(x, True) - theirs.hessian(x, True)
    assert abs(projected).max() < 1e-8 * abs(theirs.hessian(x, True)).max()


def test_bad_input_is_refused():
    elements = Elements.linear(MESH)
    directions = _directions(len(elements.cells))
    with pytest.raises(InputError, match="unit length"):
        ActiveFibres(elements, 2 * directions, 1.0)
    with pytest.raises(InputError, match="negative"):
        ActiveFibres(elements, directions, -1.0)
    twice = elements.interpolation(np.full((2, 3), 0.5))
    with pytest.raises(InputError, match="no length"):
        Strands(twice, chain(2), elements.nodes, 1.0)


def test_crushing_is_felt_below_a_share_of_the_volume_alone():
    crushing = QuadratureCrushing(Elements.linear(MESH), 7.0)
    assert crushing.value(MESH.vertices * [1, 1, 1.01 * CRUSHED]) == 0.0
    shares = np.array([0.9, 0.5, 0.2, 0.02, -0.1]) * CRUSHED
    values = np.array([crushing.value(MESH.vertices * [1, 1, share]) for share in shares])
    assert values[0] > 0 and (np.diff(values) > 0).all()


def test_a_cable_carries_its_tension_whatever_its_length():
    ends = Cable(np.eye(2), chain(2), 40.0)
    for length in (0.5, 1.0, 3.0):
        force = ends.gradient(np.array([[0.0, 0, 0], [length, 0, 0]]))
        np.testing.assert_allclose(force, [[-40.0, 0, 0], [40.0, 0, 0]], rtol=1e-5)


def test_a_tet_that_is_pressed_flat_is_not_turned_inside_out():
    """Its apex is pushed at the held face by a pressure of 500 times Young's modulus."""
    mesh = TetMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 1, 2, 3]]))
    elements, apex = Elements.linear(mesh), sp.eye(4, format="csr")[[3]]
    soft = [Solid(elements, Material(3.0, 0.45)), QuadratureCrushing(elements, 10.0)]
    push = Pull(apex, np.array([[0.0, 0.0, -250.0]]))
    found = solve([*soft, push], mesh.vertices, fixed=np.arange(9), options=Options(untangle=False))
    assert 0.0 < found.x[3, 2] < 0.1
    assert np.linalg.norm(sum(p.gradient(found.x) for p in soft)[3] - [0.0, 0.0, -250.0]) < 1e-2
