"""Implicit Euler steps by the solver of equilibria, against discrete and analytic solutions."""

import numpy as np
import pytest
import scipy.sparse as sp
from tests.fem.bodies import box

from handpipe.core.errors import InputError
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.inertia import Inertia, mass_matrix
from handpipe.fem.potentials.pull import Pull
from handpipe.fem.solver.equilibrium import Options, solve

DENSITY = 1e-6  # kg/mm^3
EXACT = Options(displacement_tolerance=1e-10, force_tolerance=1e-10)


def test_mass_gives_the_kinetic_energy_of_a_turning_box():
    size = (4.0, 2.0, 1.0)
    vertices, tets = box(size, (2, 2, 1))
    mass = mass_matrix(vertices, tets, DENSITY)
    total = DENSITY * np.prod(size)
    assert mass.sum() == pytest.approx(total)
    omega = np.array([0.3, -0.2, 0.5])
    velocity = np.cross(omega, vertices - np.array(size) / 2)
    a, b, c = np.square(size)
    inertia = total / 12 * np.array([b + c, a + c, a + b])
    energy = 0.5 * np.vdot(velocity, mass @ velocity)
    assert energy == pytest.approx(0.5 * inertia @ omega**2, rel=1e-12)


def test_free_fall_is_the_discrete_solution_and_keeps_the_shape():
    vertices, tets = box((1.0, 1.0, 2.0), (2, 2, 2))
    mass = mass_matrix(vertices, tets, DENSITY)
    g, h, steps = np.array([0.0, 0.0, -9810.0]), 1e-3, 5  # mm/s^2
    everywhere = sp.eye(len(vertices), format="csr")
    weight = Pull(everywhere, np.outer(mass.sum(axis=1), g))
    body, start = Elastic(vertices, tets, Material(6.0, 0.45)), np.array([10.0, 0.0, 300.0])
    inertia = Inertia(mass, vertices, np.tile(start, (len(vertices), 1)), h)
    x = vertices
    for _ in range(steps):
        x = solve([body, weight, inertia], x, options=EXACT).x
        inertia = inertia.after(x)
    fallen = h * steps * start + 0.5 * steps * (steps + 1) * h**2 * g  # sum of h (v0 + k h g)
    np.testing.assert_allclose(x, vertices + fallen, atol=1e-9)


def test_bar_swings_at_the_analytic_frequency_with_the_damping_of_implicit_euler():
    length, young = 10.0, 6.0
    vertices, tets = box((length, 1.0, 1.0), (20, 1, 1))
    body = Elastic(vertices, tets, Material(young, 0.0))
    mass = mass_matrix(vertices, tets, DENSITY)
    omega = np.pi / (2 * length) * np.sqrt(young / DENSITY)  # fixed at one end, free at the other
    h = 2 * np.pi / omega / 40
    fixed = np.zeros(vertices.shape, dtype=bool)
    fixed[vertices[:, 0] == 0] = True
    fixed[:, 1:] = True
    mode = np.sin(np.pi * vertices[:, 0] / (2 * length))
    x = vertices + 1e-4 * mode[:, None] * [1.0, 0.0, 0.0]
    inertia, swing = Inertia(mass, x, np.zeros_like(x), h), [1e-4, 1e-4]
    for _ in range(30):
        x = solve([body, inertia], x, fixed=fixed, options=EXACT).x
        inertia = inertia.after(x)
        swing.append(float(mode @ mass @ (x - vertices)[:, 0] / (mode @ mass @ mode)))
    # Each mode obeys (1 + (h omega)^2) u2 - 2 u1 + u0 = 0, whose roots have this frequency and damping.
    u = np.array(swing)
    (a, b), *_ = np.linalg.lstsq(np.stack([u[1:-1], u[:-2]], axis=1), u[2:], rcond=None)
    root = 0.5 * (a + np.emath.sqrt(a**2 + 4 * b))
    assert abs(np.angle(root)) / h == pytest.approx(np.arctan(h * omega) / h, rel=2e-3)
    assert abs(root) == pytest.approx(1 / np.sqrt(1 + (h * omega) ** 2), rel=1e-3)
    assert np.tan(abs(np.angle(root))) / h == pytest.approx(omega, rel=2e-3)  # damping accounted for


def test_momentum_is_kept_without_forces():
    vertices, tets = box((2.0, 1.0, 1.0), (4, 2, 2))
    mass = mass_matrix(vertices, tets, DENSITY)
    velocity = 500 * np.random.default_rng(0).normal(size=vertices.shape)
    body, inertia = Elastic(vertices, tets, Material(6.0, 0.45)), Inertia(mass, vertices, velocity, 2e-5)
    momentum, x = (mass @ velocity).sum(axis=0), vertices
    for _ in range(4):
        x = solve([body, inertia], x, options=EXACT).x
        np.testing.assert_allclose(
            (mass @ inertia.velocity(x)).sum(axis=0), momentum, atol=1e-7 * np.linalg.norm(momentum)
        )
        inertia = inertia.after(x)
    assert np.ptp(body.deformation_gradients(x)[:, 0, 0]) > 0.01  # it does swing


def test_a_step_without_time_is_refused():
    with pytest.raises(InputError, match="time_step"):
        Inertia(sp.eye(2), np.zeros((2, 3)), np.zeros((2, 3)), 0.0)
