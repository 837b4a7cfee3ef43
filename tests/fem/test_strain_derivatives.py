"""Derivatives of energy by plastic strain, against differences and against the derivative of forces."""

import numpy as np
import pytest
from tests.fem.bodies import box

from handpipe.fem.elements import plasticity
from handpipe.fem.elements.materials import Material
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.strain_derivatives import strain_gradient, strain_hessian

VERTICES, TETS = box((2.0, 1.0, 1.0), (2, 1, 1))
STEP = 1e-5


@pytest.fixture(params=[("stable-neo-hookean", 1.0), ("stable-neo-hookean", -0.8), ("stvk", 1.0)])
def state(request):
    model, mirror = request.param
    rng = np.random.default_rng(0)
    strains = plasticity.exp(0.4 * rng.normal(size=(len(TETS), 6)))
    weights = rng.uniform(0.2, 1.0, len(TETS))
    body = Elastic(VERTICES, TETS, Material(6.0, 0.48, model), strains, weights)
    x = VERTICES * [1.0, 1.0, mirror] + 0.1 * rng.normal(size=VERTICES.shape)
    return body, x, rng.normal(size=strains.shape)


def test_gradient_by_strains(state):
    body, x, change = state
    ahead, behind = (body.with_strains(body.strains + s * STEP * change).value(x) for s in (1, -1))
    slope = (ahead - behind) / (2 * STEP)
    assert np.vdot(strain_gradient(body, x), change) == pytest.approx(slope, rel=1e-6)


def test_hessian_by_strains(state):
    body, x, change = state
    ahead, behind = (strain_gradient(body.with_strains(body.strains + s * STEP * change), x) for s in (1, -1))
    hessian = strain_hessian(body, x)
    turned = np.einsum("eab,eb->ea", hessian, change)
    difference = (ahead - behind) / (2 * STEP)
    np.testing.assert_allclose(turned, difference, atol=1e-6 * np.abs(difference).max())
    np.testing.assert_allclose(hessian, hessian.transpose(0, 2, 1), rtol=1e-9, atol=1e-9 * abs(hessian).max())


def test_mixed_derivatives_are_equal(state):
    body, x, _ = state
    direction = np.random.default_rng(1).normal(size=x.shape)
    ahead, behind = (strain_gradient(body, x + s * STEP * direction) for s in (1, -1))
    mixed = (body.strain_jacobian(x).T @ direction.ravel()).reshape(-1, 6)
    np.testing.assert_allclose(mixed, (ahead - behind) / (2 * STEP), atol=1e-6 * np.abs(mixed).max())
