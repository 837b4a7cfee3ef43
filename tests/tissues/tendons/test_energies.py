"""Energies of the rod against finite differences and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from handpipe.core.arrays import Array
from handpipe.mesh.surfaces.distance import Distance
from handpipe.tissues.tendons.fitting.surface_fit import SurfaceFit, TendonTarget
from handpipe.tissues.tendons.fitting.twist import twist_energy, twist_gradient
from handpipe.tissues.tendons.rods.energies import (
    Bend,
    EndForce,
    Hooks,
    RodEnergy,
    closest_on_spline,
    empty_blocks,
    spline_shape,
)
from handpipe.tissues.tendons.rods.rod import frames, resample, unit
from handpipe.tissues.tendons.rods.tube import Tube, round_surface

STEP = 1e-6  # mm, of central differences


def wavy_rod(seed: int = 0, count: int = 20) -> Array:
    random = np.random.default_rng(seed)
    return np.cumsum(unit([1.0, 0, 0] + 0.3 * random.standard_normal((count, 3))), axis=0)


def surface_fit(x: Array) -> SurfaceFit:
    straight = np.stack([np.arange(len(x)) * 1.0, np.zeros(len(x)), np.zeros(len(x))], axis=1)
    normal = np.array([0.0, 0.0, 1.0])
    tube = Tube.bind(round_surface(straight, 1.5), straight, frames(straight, normal))
    return SurfaceFit(tube, TendonTarget(Distance(round_surface(x + [0, 0.2, 0.1], 1.4))), normal, 25.0, 1.0)


def energy(name: str, x: Array) -> RodEnergy:
    random = np.random.default_rng(1)
    made: dict[str, RodEnergy] = {
        "pull": EndForce(np.array([0.1, -0.4, 0.3])),
        "bend": Bend(0.7, 1.0),
        "hooks": Hooks(x[3:17:2] + 0.3 * random.standard_normal((7, 3)), random.uniform(0.5, 2.0, 7)),
        "surface": surface_fit(x),
    }
    made[name].refresh(x)
    return made[name]


def differences(function, x: Array) -> Array:
    out = []
    for i in range(x.size):
        shift = np.zeros(x.size)
        shift[i] = STEP
        moved = shift.reshape(x.shape)
        out.append((function(x + moved) - function(x - moved)) / (2 * STEP))
    return np.array(out)


def dense(blocks: Array) -> Array:
    n = len(blocks)
    out = np.zeros((n, 3, n, 3))
    for i in range(n):
        for k in range(min(blocks.shape[1], n - i)):
            out[i, :, i + k] = blocks[i, k]
            out[i + k, :, i] = blocks[i, k].T
    return out.reshape(3 * n, 3 * n)


@pytest.mark.parametrize("name", ["pull", "bend", "hooks", "surface"])
def test_gradient(name: str) -> None:
    x = wavy_rod()
    term = energy(name, x)
    expected = differences(term.value, x).reshape(x.shape)
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(term.gradient(x), expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", ["pull", "bend", "hooks"])
def test_hessian(name: str) -> None:
    x = wavy_rod()
    term = energy(name, x)
    blocks = empty_blocks(len(x))
    term.add_hessian(x, blocks, exact=True)
    expected = differences(lambda y: term.gradient(y).ravel(), x)
    np.testing.assert_allclose(dense(blocks), expected, atol=1e-6 * max(np.abs(expected).max(), 1.0))


@pytest.mark.parametrize("name", ["hooks", "surface"])
def test_gauss_newton_hessian_is_positive(name: str) -> None:
    x = wavy_rod()
    blocks = empty_blocks(len(x))
    energy(name, x).add_hessian(x, blocks, exact=False)
    values = np.linalg.eigvalsh(dense(blocks))
    assert values[0] > -1e-10 * values[-1] and values[-1] > 0


def test_bend_is_the_dot_product_energy() -> None:
    x = wavy_rod()
    d = unit(np.diff(x, axis=0))
    assert Bend(0.7, 1.0).value(x) == pytest.approx(0.7 * np.sum(1 - np.sum(d[1:] * d[:-1], axis=1)))


def test_closest_point_of_the_spline_against_dense_sampling() -> None:
    x = wavy_rod()
    points = x[2:18] + 0.4 * np.random.default_rng(3).standard_normal((16, 3))
    t = np.linspace(0, 1, 2001)
    curve = np.concatenate([spline_shape(t) @ x[i - 1 : i + 2] for i in range(1, len(x) - 1)])
    expected = np.linalg.norm(points[:, None] - curve[None], axis=2).min(axis=1)
    piece, parameter = closest_on_spline(points, x)
    found = np.einsum("ka,kaj->kj", spline_shape(parameter), x[piece[:, None] + np.array([-1, 0, 1])])
    np.testing.assert_allclose(np.linalg.norm(found - points, axis=1), expected, atol=1e-5)


def test_hooks_past_the_ends_let_go() -> None:
    x = np.stack([np.arange(10.0), np.zeros(10), np.zeros(10)], axis=1)
    hooks = Hooks(np.array([[-2.0, 0.3, 0], [4.0, 0.3, 0], [12.0, 0.3, 0]]))
    hooks.refresh(x)
    assert hooks.engaged.tolist() == [False, True, False]
    assert hooks.value(x) == pytest.approx(0.09)


def test_twist_gradient() -> None:
    angles = np.random.default_rng(0).normal(size=12)
    expected = differences(lambda a: twist_energy(a, 0.7), angles)
    np.testing.assert_allclose(twist_gradient(angles, 0.7), expected, atol=1e-8)


def test_resampled_rod_has_equal_segments_and_both_ends() -> None:
    s = np.linspace(0, 4, 300)
    curve = np.stack([10 * np.cos(s), 10 * np.sin(s), 3 * s], axis=1)
    x = resample(curve, 1.1)
    lengths = np.linalg.norm(np.diff(x, axis=0), axis=1)
    np.testing.assert_allclose(lengths, lengths[0], rtol=1e-9)
    np.testing.assert_allclose(x[[0, -1]], curve[[0, -1]], atol=1e-8)
