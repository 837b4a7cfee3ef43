"""Weights are those that the frames were made with; a quadratic form on a simplex has its least value."""

import numpy as np
import pytest
from scipy.optimize import minimize

from handpipe.levels.blend_weights import fit_weights, least_on_simplex
from handpipe.skeleton.posing import bone_weights

from .three_bones import BONES, known_weights, motions, rig, skinned, tube


def test_known_weights_are_found_from_frames() -> None:
    rest, made = tube(8.0).vertices, rig()
    truth = known_weights(rest)
    angles = np.radians(np.random.default_rng(0).uniform(-20, 80, (12, 2)))
    moved = np.stack([skinned(rest, truth, a, np.zeros_like(rest)) for a in angles])
    given = np.array([[np.column_stack([m.rotation, m.translation]) for m in motions(a)] for a in angles])
    before = bone_weights(rest, {bone: made.surfaces[bone] for bone in BONES})
    joints, weights = fit_weights(rest, moved, given, before)
    found = np.zeros_like(truth)
    np.add.at(found, (np.arange(len(found))[:, None], joints), weights)
    assert weights.sum(axis=1) == pytest.approx(1.0)
    assert weights.min() >= 0
    assert np.abs(found - truth).max() < 2e-3
    assert np.abs(before - truth).max() > 0.05  # distances alone do not give them
    assert (np.diff(weights, axis=1) <= 0).all()


def test_the_least_value_on_a_simplex_is_that_of_another_solver() -> None:
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(20, 5, 5)) + rng.normal(size=(20, 5, 1))
    system = roots @ roots.transpose(0, 2, 1)
    found = least_on_simplex(system, most=5)
    for matrix, w in zip(system, found, strict=True):
        other = minimize(
            lambda v, m=matrix: v @ m @ v,
            np.full(5, 0.2),
            jac=lambda v, m=matrix: 2 * m @ v,
            bounds=[(0, 1)] * 5,
            constraints={"type": "eq", "fun": lambda v: v.sum() - 1},
            options={"ftol": 1e-14},
        )
        assert w @ matrix @ w == pytest.approx(other.fun, rel=1e-6, abs=1e-9)


def test_at_most_four_bones_have_a_weight() -> None:
    system = np.tile(np.eye(6), (3, 1, 1))  # whose least value has all six alike
    found = least_on_simplex(system)
    assert ((found > 0).sum(axis=1) == 4).all()
    assert found.max(axis=1) == pytest.approx(0.25)
