"""Viscosity against the creep of a Kelvin-Voigt solid, and finite differences."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation
from tests.fem.bodies import box

from handpipe.core.errors import InputError
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.potentials.viscosity import Viscosity
from handpipe.fem.solver.equilibrium import Options, solve

EXACT = Options(displacement_tolerance=1e-10, force_tolerance=1e-10)
LENGTH, YOUNG, STRESS = 4.0, 6.0, 1e-4  # mm, kPa, kPa


def creep(ratio: float, steps: int) -> np.ndarray:
    """Strain (steps,) after each step of a bar without Poisson's ratio, pulled at one end."""
    body = Elastic(*box((LENGTH, 1.0, 1.0), (4, 1, 1)), Material(YOUNG, 0.0))
    x, end = body.vertices, body.vertices[:, 0] == LENGTH
    areas = np.zeros(len(x))  # mm^2 of the end that belong to each vertex
    for tet in body.tets[end[body.tets].sum(axis=1) == 3]:
        corners = tet[end[tet]]
        a, b, c = x[corners]
        areas[corners] += np.linalg.norm(np.cross(b - a, c - a)) / 6
    pull = Pull(sp.diags(areas), np.tile([STRESS, 0.0, 0.0], (len(x), 1)))
    fixed = np.repeat(x[:, :1] == 0, 3, axis=1) | [False, True, True]
    found = []
    for _ in range(steps):
        x = solve([body, pull, Viscosity(body, x, ratio)], x, fixed=fixed, options=EXACT).x
        found.append(x[end, 0].mean() / LENGTH - 1)
    return np.array(found)


@pytest.mark.parametrize("ratio", [0.0, 0.5, 2.0])
def test_a_pulled_bar_creeps_as_implicit_euler_has_it(ratio):
    """e_n = (e + r e_(n-1)) / (1 + r): what is left of the elastic strain e falls by r / (1 + r) a step."""
    left = 1 - creep(ratio, 6) * YOUNG / STRESS
    np.testing.assert_allclose(left, (ratio / (1 + ratio)) ** np.arange(1, 7), rtol=0, atol=1e-4)


def test_short_steps_creep_as_the_exponential():
    """A step of a twentieth of the retardation time, up to that time."""
    left = 1 - creep(20.0, 20) * YOUNG / STRESS
    assert left[-1] == pytest.approx(np.exp(-1), rel=0.03)


def moved() -> tuple[Elastic, np.ndarray, np.ndarray]:
    """A strained block, where its step began and where it is."""
    rng = np.random.default_rng(1)
    vertices, tets = box((2.0, 1.0, 1.0), (2, 1, 1))
    strains = np.tile([1.1, 0.02, 0.0, 0.95, 0.01, 1.0], (len(tets), 1))
    body = Elastic(vertices, tets, Material(6.0, 0.45), strains, rng.uniform(0.5, 1.0, len(tets)))
    began = vertices @ np.diag([1.2, 0.9, 1.0]) + rng.normal(0.0, 0.03, vertices.shape)
    return body, began, began + rng.normal(0.0, 0.05, vertices.shape)


def test_rigid_motion_meets_no_resistance():
    body, began, _ = moved()
    turned = Rotation.from_rotvec([0.3, -1.0, 0.5]).apply(began) + [1.0, 2.0, 3.0]
    viscosity = Viscosity(body, began, 2.0)
    assert viscosity.value(turned) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(viscosity.gradient(turned), 0.0, atol=1e-12)


def test_forces_and_stiffness_are_derivatives_of_the_energy():
    body, began, x = moved()
    viscosity, h = Viscosity(body, began, 0.7), 1e-6
    direction = np.random.default_rng(2).normal(size=x.shape)
    ahead, behind = x + h * direction, x - h * direction
    slope = (viscosity.value(ahead) - viscosity.value(behind)) / (2 * h)
    assert np.vdot(viscosity.gradient(x), direction) == pytest.approx(slope, rel=1e-7)
    change = (viscosity.gradient(ahead) - viscosity.gradient(behind)) / (2 * h)
    along = (viscosity.hessian(x) @ direction.ravel()).reshape(-1, 3)
    np.testing.assert_allclose(along, change, atol=1e-6 * np.abs(change).max())


def test_it_counts_the_material_and_not_the_volume_where_the_step_began():
    """A block that was stretched to twice its volume has the mass, and so the viscosity, that it had."""
    body, *_ = moved()
    plain = Elastic(body.vertices, body.tets, body.material, weights=body.weights)
    grown, shear = 2 ** (1 / 3), np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    sheared = body.vertices @ shear.T
    energy = Viscosity(body, grown * body.vertices, 1.0).value(grown * sheared)
    assert energy == pytest.approx(plain.value(sheared), rel=1e-9)


def test_some_of_its_tets_give_the_change_of_its_energy():
    body, began, x = moved()
    viscosity, moving = Viscosity(body, began, 0.7), np.arange(len(x)) == 0
    kept = np.unique(body.tets[moving[body.tets].any(axis=1)])
    part, further = viscosity.near(moving, kept), x + 0.01 * moving[:, None]
    change = viscosity.value(further) - viscosity.value(x)
    assert part.value(further[kept]) - part.value(x[kept]) == pytest.approx(change, rel=1e-9)


def test_what_is_no_step_is_refused():
    body, began, _ = moved()
    with pytest.raises(InputError, match=r"ratio: is -1"):
        Viscosity(body, began, -1.0)
    with pytest.raises(InputError, match=r"tet \d+ has volume"):
        Viscosity(body, began * [1, 1, -1], 1.0)
