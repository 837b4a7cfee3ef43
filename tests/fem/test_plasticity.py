"""Strain algebra and the polar decomposition's derivatives."""

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

from handpipe.core.errors import InputError
from handpipe.fem.elements import plasticity
from handpipe.fem.elements.matrix3 import rotational_svd


def _gradients(kind):
    rng = np.random.default_rng(0)
    rotations = Rotation.random(20, random_state=1).as_matrix()
    other = Rotation.random(20, random_state=2).as_matrix()
    values = {
        "general": rng.uniform(0.3, 2.0, (20, 3)),
        "repeated": np.tile([0.8, 0.8, 0.8], (20, 1)),
        "near-repeated": 1.0 + 1e-9 * rng.normal(size=(20, 3)),
        "flat": np.tile([1.5, 0.7, 0.0], (20, 1)),
        "inverted": np.tile([1.4, 0.9, -0.3], (20, 1)),
    }[kind]
    return rotations @ (values[:, :, None] * other)


KINDS = ["general", "repeated", "near-repeated", "flat", "inverted"]


def test_exp_and_log_are_scipys():
    strains = np.random.default_rng(0).normal(size=(5, 6))
    found = plasticity.to_matrices(plasticity.exp(strains))
    for matrix, expected in zip(found, plasticity.to_matrices(strains), strict=True):
        np.testing.assert_allclose(matrix, scipy.linalg.expm(expected), rtol=1e-10)
    np.testing.assert_allclose(plasticity.log(plasticity.exp(strains)), strains, atol=1e-10)
    product = plasticity.to_matrices(plasticity.inverse(plasticity.exp(strains))) @ found
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-9)
    with pytest.raises(InputError, match="principal value"):
        plasticity.log(-plasticity.identity(1))


@pytest.mark.parametrize("spread", [1.0, 1e-3, 0.0])
def test_derivative_of_exp(spread):
    rng = np.random.default_rng(0)
    strains = 0.3 * plasticity.identity(4) + spread * rng.normal(size=(4, 6))
    change, step = rng.normal(size=(4, 6)), 1e-6
    ahead, behind = plasticity.exp(strains + step * change), plasticity.exp(strains - step * change)
    operator = plasticity.per_tet_operator(plasticity.exp_derivative(strains))
    np.testing.assert_allclose(
        (operator @ change.ravel()).reshape(4, 6), (ahead - behind) / (2 * step), atol=2e-8
    )


@pytest.mark.parametrize("kind", KINDS)
def test_polar_decomposition(kind):
    f = _gradients(kind)
    rotations, stretches = plasticity.polar(f)
    np.testing.assert_allclose(rotations @ plasticity.to_matrices(stretches), f, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0, atol=1e-12)
    identity = np.broadcast_to(np.eye(3), f.shape)
    np.testing.assert_allclose(rotations.transpose(0, 2, 1) @ rotations, identity, atol=1e-12)
    if kind in ("general", "repeated"):
        np.testing.assert_allclose(rotations[0], scipy.linalg.polar(f[0])[0], atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_polar_derivatives_agree_with_differences(kind):
    f = _gradients(kind)
    rng = np.random.default_rng(3)
    change, weights, step = rng.normal(size=f.shape), rng.normal(size=(len(f), 6)), 1e-6
    ahead, behind = f + step * change, f - step * change
    first = (plasticity.polar(ahead)[1] - plasticity.polar(behind)[1]) / (2 * step)
    gradient = np.einsum("mab,mb->ma", plasticity.polar_gradient(f), change.reshape(-1, 9))
    np.testing.assert_allclose(gradient, first, atol=1e-7)
    turned = (plasticity.polar_gradient(ahead) - plasticity.polar_gradient(behind)) / (2 * step)
    second = np.einsum("ma,mab->mb", weights, turned)
    hessian = plasticity.polar_hessian(f, weights)
    np.testing.assert_allclose(np.einsum("mab,mb->ma", hessian, change.reshape(-1, 9)), second, atol=1e-6)
    np.testing.assert_allclose(hessian, hessian.transpose(0, 2, 1), atol=1e-10)


@pytest.mark.parametrize("scale", [1.0, 1e-170, 1e160])
@pytest.mark.parametrize(
    "values", [(0, 0, 0), (2, 0, 0), (2, 1e-15, 0), (2, 1, 0), (2, 1e-9, -1e-12), (1, 1, 1)]
)
def test_rotational_svd_of_any_rank_and_size(values, scale):
    u, v, sigma = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for seed in range(20):
        turns = Rotation.random(2, random_state=seed).as_matrix()
        f = turns[0] @ (scale * np.array(values, dtype=float)[:, None] * turns[1])
        rotational_svd(f, u, sigma, v)
        np.testing.assert_allclose(u @ (sigma[:, None] * v.T), f, atol=1e-13 * scale, rtol=0)
        for rotation in (u, v):
            np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-13)
            assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-12)


def test_polar_stays_finite_where_it_is_not_unique():
    f = np.stack([np.zeros((3, 3)), np.diag([1.0, 0.0, 0.0]), np.diag([1.0, 0.5, -0.5]), np.eye(3) * -1])
    for array in (*plasticity.polar(f), plasticity.polar_gradient(f)):
        assert np.all(np.isfinite(array))
    assert np.all(np.isfinite(plasticity.polar_hessian(f, np.ones((4, 6)))))
