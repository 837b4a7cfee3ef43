"""Static equilibrium of a rod of constant segment lengths, by Newton's method on the segments' directions.

The constraints of Eq. 5 and 9 (Zheng et al. 2022) leave the unit directions of the segments free. Each step
solves the Newton system with the linearised constraints (a banded KKT system, linear in the number of
segments) and turns the directions by it; the positions follow by summation from the fixed first vertex.
Lengths are thus exact in every iterate, and the energy itself is the merit function of the line search.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.linalg import LinAlgError, cholesky_banded, solve_banded

from handpipe.core import Array, ConvergenceError
from handpipe.tissues.tendons.rods.energies import REACH, RodEnergy, empty_blocks
from handpipe.tissues.tendons.rods.rod import directions, segment_length, unit

log = logging.getLogger(__name__)

LEAST_ADDED, MOST_ADDED = 1e-3, 1e8  # tension that is added to keep a descent, over the largest force
PENALTY = 1e6  # on constraints, over the largest second derivative
EXACT = 1.0  # up to this added tension hooks give their whole second derivative, beyond it a convex part
BAND = 4 * REACH + 2  # unknowns are ordered x_0, multiplier_0, x_1, multiplier_1, ...
ARMIJO = 1e-4  # share of the decrease of a rod's energy, as predicted, that a step must bring


@dataclass(frozen=True)
class RodOptions:
    """Tolerances and limits of the solver.

    `tolerance` is the unbalanced lateral force over the largest tension; a whole Newton step below
    `smallest_step` in mm ends the solution as well.
    """

    tolerance: float = 1e-7  # unbalanced lateral force over the largest tension
    smallest_step: float = 1e-7  # mm
    max_iterations: int = 200  # of one solve
    largest_turn: float = 0.5  # rad a step
    accept_unfinished: bool = False  # after `max_iterations`, for callers that iterate themselves


@dataclass(frozen=True)
class RodEquilibrium:
    """x (Q+1, 3) in mm; tension (Q,) of the segments; iterations; unbalanced force over tension."""

    x: Array
    tension: Array
    iterations: int
    residual: float


@njit(cache=True)
def _kkt_bands(blocks: Array, stiffness: Array, d: Array) -> Array:
    """The KKT matrix in LAPACK's band storage; unit rows fix the first vertex."""
    n = len(blocks)
    bands = np.zeros((2 * BAND + 1, 4 * n - 1))
    for i in range(n):
        for k in range(min(REACH + 1, n - i)):
            j = i + k
            for a in range(3):
                for b in range(3):
                    value = blocks[i, k, a, b]
                    if i == 0:
                        value = 1.0 if j == 0 and a == b else 0.0
                    row, column = 4 * i + a, 4 * j + b
                    bands[BAND + row - column, column] += value
                    if k > 0:
                        bands[BAND + column - row, row] += value
    for i in range(n - 1):
        m = 4 * i + 3
        for a in range(3):
            left, right = 4 * i + a, 4 * (i + 1) + a
            bands[BAND, right] += stiffness[i]
            bands[BAND + right - m, m] = d[i, a]
            bands[BAND + m - right, right] = d[i, a]
            if i > 0:
                bands[BAND, left] += stiffness[i]
                bands[BAND + right - left, left] -= stiffness[i]
                bands[BAND + left - right, right] -= stiffness[i]
                bands[BAND + left - m, m] = -d[i, a]
                bands[BAND + m - left, left] = -d[i, a]
    return bands


@njit(cache=True)
def _augmented_bands(blocks: Array, stiffness: Array, d: Array, penalty: float) -> Array:
    """The KKT matrix without the first vertex, `penalty` in place of its multipliers, in lower bands."""
    n = len(blocks)
    bands = np.zeros((3 * (REACH + 1), 3 * (n - 1)))
    for i in range(1, n):
        for a in range(3):
            for b in range(3):
                across = penalty * d[i - 1, a] * d[i - 1, b] + (stiffness[i - 1] if a == b else 0.0)
                if i + 1 < n:
                    beyond = penalty * d[i, a] * d[i, b] + (stiffness[i] if a == b else 0.0)
                    across += beyond
                    bands[3 + b - a, 3 * (i - 1) + a] -= beyond
                if b >= a:
                    bands[b - a, 3 * (i - 1) + a] += blocks[i, 0, a, b] + across
                for k in range(1, min(REACH + 1, n - i)):
                    bands[3 * k + b - a, 3 * (i - 1) + a] += blocks[i, k, a, b]
    return bands


def _is_convex(blocks: Array, stiffness: Array, d: Array) -> bool:
    """Whether the second derivative is positive in all directions that keep the segments' lengths.

    It is where the augmented matrix is positive definite, whatever its penalty.
    """
    penalty = PENALTY * max(float(np.abs(blocks).max()), float(np.abs(stiffness).max()))
    try:
        cholesky_banded(_augmented_bands(blocks, stiffness, d, penalty), lower=True, check_finite=False)
    except LinAlgError:
        return False
    return True


def _forces(gradient: Array, d: Array) -> tuple[Array, Array]:
    """Tension (Q,) and unbalanced lateral force (Q,) of the segments, from the forces beyond each of them."""
    beyond = -np.cumsum(gradient[:0:-1], axis=0)[::-1]
    tension = np.sum(beyond * d, axis=1)
    return tension, np.linalg.norm(beyond - tension[:, None] * d, axis=1)


def _newton_turn(
    blocks: Array, stiffness: Array, gradient: Array, d: Array, length: float
) -> tuple[Array, float]:
    """Change of the segments' directions (Q, 3), and the energy's slope along it.

    stiffness (Q,): the constraints' curvature, tension over length, and what makes the system convex.
    """
    rhs = np.zeros(4 * len(gradient) - 1)
    for c in range(3):
        rhs[4 + c :: 4] = -gradient[1:, c]
    solution = solve_banded((BAND, BAND), _kkt_bands(blocks, stiffness, d), rhs, check_finite=False)
    step = np.append(solution, 0.0).reshape(-1, 4)[:, :3]
    turn = np.diff(step, axis=0) / length
    return turn - np.sum(turn * d, axis=1)[:, None] * d, float(np.sum(gradient * step))


def _hessian(energies: Sequence[RodEnergy], x: Array, exact: bool) -> Array:
    blocks = empty_blocks(len(x))
    for energy in energies:
        energy.add_hessian(x, blocks, exact)
    return blocks


def _turned(x0: Array, d: Array, turn: Array, length: float) -> Array:
    moved = unit(d + turn)
    return np.vstack([x0, x0 + length * np.cumsum(moved, axis=0)])


def solve(energies: Sequence[RodEnergy], x: Array, options: RodOptions | None = None) -> RodEquilibrium:
    """Minimise a sum of energies over rods with the segment lengths and the first vertex of x (Q+1, 3).

    Zheng et al. 2022, Eq. 4, 5 and 9. All segments of x must have one length. Closest points and ICP targets
    are refreshed in each iteration. A tension is added to the rod's own in the Newton system where that is
    not convex: compressed segments and hooks beside a bend make it so.

    Raises
    ------
    ConvergenceError
        Where no equilibrium is reached.
    """
    options = options or RodOptions()
    residual, added = np.inf, 0.0
    for iteration in range(options.max_iterations):
        for energy in energies:
            energy.refresh(x)
        d = directions(x)
        gradient = sum((energy.gradient(x) for energy in energies), np.zeros_like(x))
        tension, lateral = _forces(gradient, d)
        scale = max(float(np.abs(tension).max()), 1e-12)
        residual = float(lateral.max()) / scale
        log.debug("%d: unbalanced force %.1e of the tension, added tension %.1e", iteration, residual, added)
        if residual <= options.tolerance:
            return RodEquilibrium(x, tension, iteration, residual)
        force = max(scale, float(lateral.max()))
        x, moved, added = _descend(energies, x, gradient, tension, force, added, options)
        if moved <= options.smallest_step:
            return RodEquilibrium(x, tension, iteration, residual)
    if options.accept_unfinished:
        return RodEquilibrium(x, tension, options.max_iterations, residual)
    raise ConvergenceError(
        "The rod", f"unbalanced force {residual:.1e} of the tension after {iteration + 1} steps"
    )


def _descend(
    energies: Sequence[RodEnergy],
    x: Array,
    gradient: Array,
    tension: Array,
    force: float,
    added: float,
    options: RodOptions,
) -> tuple[Array, float, float]:
    """The rod after one step; the Newton step's length in mm; the tension to add in the next step.

    Levenberg's method: the added tension grows until the step descends, and shrinks where it does at once.
    """
    d, length = directions(x), segment_length(x)
    hessians = {exact: _hessian(energies, x, exact) for exact in (True, False)}
    before = sum(energy.value(x) for energy in energies)
    rounding = 1e-14 * (abs(before) + 1.0)
    while added < MOST_ADDED * force:
        blocks, stiffness = hessians[added <= EXACT * force], (tension + added) / length
        if _is_convex(blocks, stiffness, d):
            turn, slope = _newton_turn(blocks, stiffness, gradient, d, length)
            share = min(1.0, options.largest_turn / max(float(np.linalg.norm(turn, axis=1).max()), 1e-300))
            trial = _turned(x[0], d, share * turn, length)
            if sum(energy.value(trial) for energy in energies) <= before + ARMIJO * share * slope + rounding:
                less = added / 10.0 if added > LEAST_ADDED * force else 0.0
                return trial, length * float(np.abs(np.cumsum(turn, axis=0)).max()), less
        added = max(4.0 * added, LEAST_ADDED * force)
    raise ConvergenceError("The rod", "no step decreases its energy")
