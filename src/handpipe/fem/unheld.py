"""Rigid motions that no potential feels, and the degrees of freedom to fix instead (003 section 5.5)."""

from __future__ import annotations

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from handpipe.fem.nullspace import unit_twists
from handpipe.fem.potential import Potential

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

HELD = 1e-9  # of the largest stiffness: a body softer than this against translation is looked at
UNFELT = 1e-8  # of the force's size: forces in equilibrium leave rounding
SAMPLES = 12
NOISE = 1e-2  # of the body's size


def pins(energy: Potential, matrix: sp.csr_matrix, x: Array, free: NDArray[np.bool_]) -> IntArray:
    """Unknowns whose fixing stops every rigid motion of x (n, 3) without resistance, and nothing else.

    `matrix` (3n, 3n) is the Hessian at x; `free` (3n,) masks the unknowns. Each connected part of the matrix
    is looked at by itself. A motion is unfelt where the forces in a few shapes near x do no work in it; the
    reactions of the pins then vanish at an equilibrium (003 Nullspace Lemma).
    """
    found: list[IntArray] = []
    for unknowns in _loose_parts(matrix, x, free):
        vertices = np.unique(unknowns // 3)
        found.append(_part_pins(energy, x, vertices, free))
    return np.concatenate(found) if found else np.zeros(0, dtype=np.int64)


def _loose_parts(matrix: sp.csr_matrix, x: Array, free: NDArray[np.bool_]) -> list[IntArray]:
    """Unknowns of the connected parts that do not resist some translation."""
    shifts = np.zeros((x.size, 3))
    for i in range(3):
        shifts[i::3, i] = free[i::3]
    forces = matrix @ shifts
    stiffest = float(np.abs(matrix.diagonal()).max())
    count, labels = connected_components(matrix, directed=False)
    parts = []
    for part in range(count):
        unknowns = np.flatnonzero((labels == part) & free)
        if len(unknowns) == 0:
            continue
        resistance = shifts[unknowns].T @ forces[unknowns]
        present = shifts[unknowns].any(axis=0)
        resistance = resistance[np.ix_(present, present)]
        if np.linalg.eigvalsh(0.5 * (resistance + resistance.T))[0] <= HELD * stiffest:
            parts.append(unknowns)
    return parts


def _part_pins(energy: Potential, x: Array, vertices: IntArray, free: NDArray[np.bool_]) -> IntArray:
    rng = np.random.default_rng(0)
    size, centre = float(np.ptp(x[vertices], axis=0).max()) or 1.0, x[vertices].mean(axis=0)
    rows = []
    for _ in range(SAMPLES):
        near = x.copy()
        near[vertices] += NOISE * size * rng.normal(size=(len(vertices), 3))
        modes = unit_twists(near[vertices], centre, size)
        force = energy.gradient(near)[vertices].ravel()
        length = np.linalg.norm(force)
        if length > 0:
            rows.append(force @ modes / length)
    degrees = (3 * vertices[:, None] + np.arange(3)).ravel()
    modes = unit_twists(x[vertices], centre, size)
    rows.extend(modes[~free[degrees]])
    unfelt = _nullspace(np.array(rows)) if rows else np.eye(6)
    if unfelt.shape[1] == 0:
        return np.zeros(0, dtype=np.int64)
    motions = np.where(free[degrees][:, None], modes @ unfelt, 0.0)
    pivots = scipy.linalg.qr(motions.T, mode="economic", pivoting=True)[2]
    return np.sort(degrees[pivots[: unfelt.shape[1]]])


def _nullspace(rows: Array) -> Array:
    """Directions (6, k) that rows (r, 6) do not see; rows of a body that is free are nothing but rounding."""
    _, values, directions = np.linalg.svd(rows)
    return np.asarray(directions[int((values > UNFELT).sum()) :].T)
