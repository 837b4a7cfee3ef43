"""Bars and beams with known answers: contraction, a strand that carries a load, locking."""

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.fem.bodies import box

from handpipe.fem.elements.materials import Material, piola_stresses
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.solver.equilibrium import Options, solve
from handpipe.mesh.tets.tetrahedra import TetMesh
from handpipe.synthetic.continuum.active import ActiveFibres
from handpipe.synthetic.continuum.elements import Elements
from handpipe.synthetic.continuum.solid import Solid
from handpipe.synthetic.continuum.strands import TOE, Strands, chain

TIGHT = Options(displacement_tolerance=1e-8, force_tolerance=1e-9)


def _uniaxial(material, tension):
    """Stretches along and across of a bar whose passive stress balances the active one, by root finding."""
    mu, lam = material.lame(1)

    def passive(along, across):
        return piola_stresses(0, np.diag([along, across, across])[None], mu, lam)[0]

    def across(along):
        return brentq(lambda b: passive(along, b)[1, 1], 0.5, 2.0, xtol=1e-14)

    along = brentq(lambda a: passive(a, across(a))[0, 0] + tension, 0.3, 1.0, xtol=1e-14)
    return along, across(along)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("tension", [1.0, 4.0])
def test_active_bar_contracts_until_passive_stress_balances(order, tension):
    mesh, material = TetMesh(*box((4.0, 1.0, 1.0), (4, 1, 1))), Material(6.0, 0.49)
    elements = Elements.quadratic(mesh) if order == 2 else Elements.linear(mesh)
    x = elements.nodes
    fixed = np.column_stack([x[:, 0] == 0, x[:, 1] == 0, x[:, 2] == 0])
    along = np.tile([1.0, 0.0, 0.0], (len(elements.cells), 1))
    muscle = [Solid(elements, material), ActiveFibres(elements, along, tension)]
    found = solve(muscle, x, fixed=fixed, options=TIGHT).x
    wanted = _uniaxial(material, tension)
    assert np.allclose(found, x * [wanted[0], wanted[1], wanted[1]], atol=1e-6)
    assert wanted[0] < 0.9


def _pulled_block(order, stiffness, force):
    """A soft block, 20 mm long, with a strand along its axis, pulled at the strand's end by a force in mN."""
    mesh = TetMesh(*box((20.0, 4.0, 4.0), (10, 2, 2)))
    elements = Elements.quadratic(mesh) if order == 2 else Elements.linear(mesh)
    x = elements.nodes
    line = np.column_stack([np.linspace(0, 20, 9), np.full(9, 2.0), np.full(9, 2.0)])
    points = elements.interpolation(line)
    strands = Strands(points, chain(9), x, stiffness)
    load = Pull(points[8:], np.array([[force, 0.0, 0.0]]))
    fixed = np.repeat(x[:, 0] == 0, 3)
    found = solve([Solid(elements, Material(1.0, 0.45)), strands, load], x, fixed=fixed, options=TIGHT).x
    return strands, strands.tensions(found), (points @ found - line)[:, 0]


@pytest.mark.parametrize("order", [1, 2])
def test_a_stiff_strand_in_a_soft_block_carries_the_load(order):
    _, tension, moved = _pulled_block(order, 2e4, 30.0)
    # Block against strand: E A = 16 mN of 20,000. The force of every segment is the load, to 1 %, and its
    # strain where S e^2 / (2 toe) is that force.
    assert np.allclose(tension, 30.0, rtol=0.01)
    assert moved[-1] == pytest.approx(20.0 * np.sqrt(2 * TOE * 30.0 / 2e4), rel=0.01)


def test_a_soft_strand_leaves_the_load_to_the_block():
    _, tension, moved = _pulled_block(2, 1e-3, 1.0)
    assert tension.max() < 0.001
    assert moved[-1] > 20.0 * 1.0 / 16.0  # F L / E A, and the dent where the load sits


def test_a_slack_strand_does_nothing():
    elements = Elements.linear(TetMesh(*box((2.0, 1.0, 1.0), (2, 1, 1))))
    points = elements.interpolation(np.array([[0.2, 0.5, 0.5], [1.8, 0.5, 0.5]]))
    x = 0.9 * elements.nodes
    slack = Strands(points, chain(2), elements.nodes, 1e4)
    spring = Strands(points, chain(2), elements.nodes, 1e4, two_sided=True)
    assert slack.value(x) == 0.0 and np.all(slack.gradient(x) == 0.0)
    assert spring.tensions(x) == pytest.approx([-1e3])


def _tip(order, cells, poisson):
    """Deflection in mm of a beam of 16 x 4 x 4 mm, E = 6 kPa, under 0.04 mN across its end."""
    mesh = TetMesh(*box((16.0, 4.0, 4.0), cells))
    elements = Elements.quadratic(mesh) if order == 2 else Elements.linear(mesh)
    x = elements.nodes
    corners = np.array([[16.0, y, z] for y in (0.0, 4.0) for z in (0.0, 4.0)])
    load = Pull(elements.interpolation(corners), np.tile([0.0, 0.0, 0.01], (4, 1)))
    body = Solid(elements, Material(6.0, poisson))
    found = solve([body, load], x, fixed=np.repeat(x[:, 0] == 0, 3), options=TIGHT).x
    end = elements.interpolation(np.array([[16.0, 2.0, 2.0]]))
    return float((end @ found)[0, 2] - 2.0)


def test_quadratic_elements_do_not_lock():
    # Bernoulli and Timoshenko, P L^3 / 3 E I + 6 P L / 5 G A, before the clamp is felt.
    shear = 6.0 / (2 * 1.3)
    slender = 0.04 * 16.0**3 / (3 * 6.0 * 4.0**4 / 12) + 1.2 * 0.04 * 16.0 / (shear * 16.0)
    assert _tip(2, (8, 2, 2), 0.3) == pytest.approx(slender, rel=0.05)
    finer = _tip(2, (16, 4, 4), 0.49)
    assert _tip(2, (8, 2, 2), 0.49) > 0.94 * finer
    # Linear elements on the same nodes reach less than half of it.
    assert _tip(1, (16, 4, 4), 0.49) < 0.5 * finer
