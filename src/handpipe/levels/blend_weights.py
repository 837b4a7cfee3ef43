"""Skin weights that fit simulated frames best: none negative, sum one, four bones a vertex."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.hand.exports import BONES_A_VERTEX

CANDIDATES = 6  # bones a vertex among which the four are looked for, by the weights before
TRUST = 0.05  # mm in each frame, that a weight's difference of 1 from the weights before counts as
SINGULAR = 1e-12  # of the trace: added, so that a perfect fit has an inverse


def fit_weights(rest: Array, vertices: Array, motions: Array, before: Array) -> tuple[IntArray, Array]:
    """Weights of linear blend skinning with the least squared distance to simulated vertices.

    Every set of up to four of a vertex's candidates is tried, so that the best one is found.

    Parameters
    ----------
    rest : array (n, 3)
        Neutral points, mm.
    vertices : array (F, n, 3)
        Their simulated places, mm.
    motions : array (F, b, 3, 4)
        Motions of the bones from neutral.
    before : array (n, b)
        Weights of the distance, which choose the candidates and what frames do not determine.

    Returns
    -------
    joints : array (n, 4) of int
        Numbers of the bones, by falling weight.
    weights : array (n, 4)
        Weights.
    """
    count = min(CANDIDATES, before.shape[1])
    candidates = np.argsort(-before, axis=1, kind="stable")[:, :count]
    prior = np.take_along_axis(before, candidates, axis=1)
    prior = prior / prior.sum(axis=1, keepdims=True)
    system = _system(rest, vertices, motions, candidates)
    away = np.eye(count) - prior[:, :, None]  # of weights that sum to one, their difference from the prior
    system += len(vertices) * TRUST**2 * np.einsum("nki,nkj->nij", away, away)
    weights = least_on_simplex(system)
    order = np.argsort(-weights, axis=1, kind="stable")[:, :BONES_A_VERTEX]
    joints, found = (np.take_along_axis(a, order, axis=1) for a in (candidates, weights))
    pad = [(0, 0), (0, BONES_A_VERTEX - order.shape[1])]
    return np.pad(np.where(found > 0, joints, 0), pad), np.pad(found, pad)


def _system(rest: Array, vertices: Array, motions: Array, candidates: IntArray) -> Array:
    """Matrices (n, k, k) of the squared error in weights of the candidates (n, k)."""
    found = np.zeros((len(rest), candidates.shape[1], candidates.shape[1]))
    for moved, motion in zip(vertices, motions, strict=True):
        chosen = motion[candidates]  # (n, k, 3, 4)
        error = chosen[..., :3] @ rest[:, None, :, None]
        error = error[..., 0] + chosen[..., 3] - moved[:, None]
        found += error @ error.transpose(0, 2, 1)
    return found


def least_on_simplex(system: Array, most: int = BONES_A_VERTEX) -> Array:
    """The w (n, k) with least w' A w for A (n, k, k), none negative, sum one, at most `most` above zero."""
    n, k, _ = system.shape
    ridge = SINGULAR * np.trace(system, axis1=1, axis2=2) + np.finfo(float).tiny
    system = system + ridge[:, None, None] * np.eye(k)
    best, weights = np.full(n, np.inf), np.zeros((n, k))
    for size in range(1, min(most, k) + 1):
        for chosen in combinations(range(k), size):
            part = system[:, chosen][:, :, chosen]
            found = np.linalg.solve(part, np.ones((n, size, 1)))[:, :, 0]
            total = found.sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                found, value = found / total[:, None], 1.0 / total
            better = (total > 0) & (found >= 0).all(axis=1) & (value < best)
            best[better] = value[better]
            weights[better] = 0.0
            weights[np.ix_(better, chosen)] = found[better]
    return weights
