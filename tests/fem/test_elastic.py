"""Elasticity against analytic solutions and another library."""

import numpy as np
import pytest
import scipy.optimize
import skfem
from skfem.models.elasticity import lame_parameters, linear_elasticity
from tests.fem.bodies import box

from handpipe.core.errors import InputError
from handpipe.fem.elements import plasticity
from handpipe.fem.elements.materials import (
    MODELS,
    Material,
    energy_densities,
    piola_stresses,
    semidefinite_stiffnesses,
    stiffnesses,
)
from handpipe.fem.linear.nullspace import DeflatedFactor, rigid_modes, rigid_pins
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.solver import equilibrium

YOUNG, POISSON = 6.0, 0.45


def _boundary(vertices, size):
    return ((vertices < 1e-9) | (vertices > np.asarray(size) - 1e-9)).any(axis=1)


@pytest.mark.parametrize("model", MODELS)
def test_affine_boundary_gives_affine_interior_and_one_stress(model):
    size = (3.0, 2.0, 2.0)
    vertices, tets = box(size, (3, 3, 3))
    elastic = Elastic(vertices, tets, Material(YOUNG, POISSON, model))
    affine = np.array([[1.2, 0.1, 0.0], [-0.1, 0.9, 0.2], [0.0, 0.1, 1.05]])
    start = vertices @ affine.T
    outer = _boundary(vertices, size)
    start[~outer] += 0.1 * np.random.default_rng(0).normal(size=(int((~outer).sum()), 3))
    found = equilibrium.solve([elastic], start, fixed=np.repeat(outer, 3))
    np.testing.assert_allclose(found.x, vertices @ affine.T, atol=1e-9)
    mu, lam = Material(YOUNG, POISSON, model).lame(len(tets))
    stresses = piola_stresses(MODELS[model], elastic.deformation_gradients(found.x), mu, lam)
    np.testing.assert_allclose(stresses, np.broadcast_to(stresses[0], stresses.shape), atol=1e-8)


def test_uniaxial_tension_matches_the_analytic_solution():
    size = (4.0, 1.0, 1.0)
    vertices, tets = box(size, (4, 2, 2))
    elastic = Elastic(vertices, tets, Material(YOUNG, POISSON))
    stretch = 1.5
    fixed = np.zeros_like(vertices, dtype=bool)
    ends = (vertices[:, 0] < 1e-9) | (vertices[:, 0] > 4 - 1e-9)
    fixed[ends, 0] = True
    fixed[vertices[:, 1] < 1e-9, 1] = True
    fixed[vertices[:, 2] < 1e-9, 2] = True
    found = equilibrium.solve([elastic], vertices * [stretch, 1.0, 1.0], fixed=fixed)
    # Smith et al. 2018: P = m (1 - 1/(I + 1)) F + l (J - alpha) dJ/dF, by the lateral stretch b.
    shear, lam = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    m, bulk = 4 / 3 * shear, lam + 5 / 6 * shear
    alpha = 1 + m / bulk - m / (4 * bulk)

    def stress(b, along, across):
        return m * (1 - 1 / (stretch**2 + 2 * b**2 + 1)) * along + bulk * (stretch * b**2 - alpha) * across

    b = scipy.optimize.brentq(lambda b: stress(b, b, stretch * b), 0.3, 1.2)
    np.testing.assert_allclose(found.x, vertices * [stretch, b, b], atol=1e-7)
    axial = stress(b, stretch, b**2)
    pull = elastic.gradient(found.x)[vertices[:, 0] > 4 - 1e-9, 0].sum()
    assert pull == pytest.approx(axial, rel=1e-7)


@pytest.mark.parametrize("poisson", [0.0, POISSON, 0.499])
@pytest.mark.parametrize(("model", "lambda_factor"), [("stable-neo-hookean", 1.0), ("stvk", 2.0)])
def test_small_strain_stiffness_is_linear_elasticity(model, lambda_factor, poisson):
    vertices, tets = box((3.0, 2.0, 1.0), (3, 2, 2))
    mesh = skfem.MeshTet(vertices.T, tets.T)
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))
    lam, mu = lame_parameters(YOUNG, poisson)
    reference = linear_elasticity(lambda_factor * lam, mu).assemble(basis)
    ours = Elastic(vertices, tets, Material(YOUNG, poisson, model)).hessian(vertices)
    order = basis.nodal_dofs.T.ravel()  # skfem's number of our degree of freedom 3 i + c
    assert abs(ours - reference[order][:, order]).max() < 1e-10 * abs(reference).max()


def test_a_collapsed_body_is_no_minimum_of_the_neo_hookean():
    neo, shear = MODELS["stable-neo-hookean"], np.array([2.0])
    bulk = np.array([20.0])
    collapsed = np.zeros((1, 3, 3))
    assert np.abs(stiffnesses(neo, collapsed, shear, bulk)).max() == 0.0
    start = energy_densities(neo, collapsed, shear, bulk)[0]
    assert energy_densities(neo, 1e-2 * np.eye(3)[None], shear, bulk)[0] < start
    assert energy_densities(neo, np.eye(3)[None], shear, bulk)[0] == 0.0


def test_a_free_body_takes_its_plastic_strain():
    vertices, tets = box((4.0, 2.0, 2.0), (4, 2, 2))
    strain = plasticity.exp(np.array([[0.4, 0.3, -0.2, -0.3, 0.1, 0.2]]))
    strains = np.repeat(strain, len(tets), axis=0)
    elastic = Elastic(vertices, tets, Material(YOUNG, POISSON), strains)
    found = equilibrium.solve([elastic], vertices, fixed=rigid_pins(vertices))
    stretches = plasticity.polar(elastic.deformation_gradients(found.x))[1]
    np.testing.assert_allclose(stretches, strains, atol=1e-8)
    assert elastic.value(found.x) == pytest.approx(0.0, abs=1e-9)


def test_with_strains_equals_a_new_body_and_shares_its_pattern():
    vertices, tets = box((2.0, 1.0, 1.0), (2, 1, 1))
    rng = np.random.default_rng(0)
    strains = plasticity.exp(0.2 * rng.normal(size=(len(tets), 6)))
    body = Elastic(vertices, tets, Material(YOUNG, POISSON))
    other = body.with_strains(strains)
    fresh = Elastic(vertices, tets, Material(YOUNG, POISSON), strains)
    x = vertices + 0.05 * rng.normal(size=vertices.shape)
    np.testing.assert_allclose(other.gradient(x), fresh.gradient(x), atol=1e-12)
    assert other.pattern is body.pattern
    assert np.abs(body.gradient(vertices)).max() < 1e-12


@pytest.mark.parametrize("model", MODELS)
def test_strain_jacobian_agrees_with_differences(model):
    vertices, tets = box((2.0, 1.0, 1.0), (2, 1, 1))
    rng = np.random.default_rng(0)
    strains = plasticity.exp(0.3 * rng.normal(size=(len(tets), 6)))
    body = Elastic(vertices, tets, Material(YOUNG, POISSON, model), strains)
    x = vertices + 0.1 * rng.normal(size=vertices.shape)
    change, step = rng.normal(size=strains.shape), 1e-6
    ahead = body.with_strains(strains + step * change).gradient(x)
    behind = body.with_strains(strains - step * change).gradient(x)
    difference = (ahead - behind).ravel() / (2 * step)
    np.testing.assert_allclose(
        body.strain_jacobian(x) @ change.ravel(), difference, atol=1e-7 * np.abs(difference).max()
    )


def test_stiffness_of_a_free_body_has_the_rigid_nullspace_and_deflates():
    vertices, tets = box((3.0, 1.0, 1.0), (3, 2, 2))
    stiffness = Elastic(vertices, tets, Material(YOUNG, POISSON)).hessian(vertices)
    modes = rigid_modes(vertices)
    assert np.abs(stiffness @ modes).max() < 1e-10 * abs(stiffness).max()
    force = np.random.default_rng(0).normal(size=(vertices.size, 2))
    force -= modes @ (modes.T @ force)
    moved = DeflatedFactor(stiffness, modes).solve(force)
    np.testing.assert_allclose(stiffness @ moved, force, atol=1e-9)
    np.testing.assert_allclose(modes.T @ moved, 0.0, atol=1e-9)
    np.testing.assert_allclose(moved, np.linalg.pinv(stiffness.toarray()) @ force, atol=1e-8)


def test_turned_tets_and_impossible_strains_are_refused():
    vertices, tets = box((1.0, 1.0, 1.0), (1, 1, 1))
    with pytest.raises(InputError, match="volume"):
        Elastic(vertices, tets[:, [0, 1, 3, 2]], Material(YOUNG, POISSON))
    with pytest.raises(InputError, match="determinant"):
        Elastic(vertices, tets, Material(YOUNG, POISSON), -plasticity.identity(len(tets)))
    with pytest.raises(InputError, match="poisson"):
        Material(YOUNG, 0.5)


@pytest.mark.parametrize("model", MODELS)
def test_semidefinite_stiffness_is_the_exact_one_without_its_negative_eigenvalues(model):
    f = np.random.default_rng(4).normal(size=(50, 3, 3))
    f[:5] = np.diag([0.3, 0.3, 0.3])  # equal singular values
    f[5:10] = np.diag([0.2, 0.7, -0.4])
    mu, lam = np.full(len(f), 2.0), np.full(len(f), 30.0)
    values, vectors = np.linalg.eigh(stiffnesses(MODELS[model], f, mu, lam))
    assert (values[:, 0] < 0).any()
    expected = (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    found = semidefinite_stiffnesses(MODELS[model], f, mu, lam)
    assert np.allclose(found, expected, atol=1e-9 * values[:, -1:, None])
