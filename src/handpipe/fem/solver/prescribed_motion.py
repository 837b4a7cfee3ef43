"""Moves obstacles and fixed vertices to prescribed places without intersections on the way."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handpipe.core import Array, BoolArray, ConvergenceError
from handpipe.fem.contact.barrier import Barrier
from handpipe.fem.linear.factorisation import NotPositiveDefinite, SingularMatrix
from handpipe.fem.minimisation.record import Equilibrium, Options, finite
from handpipe.fem.minimisation.workspace import Workspace
from handpipe.fem.potentials.potential import Potential, Sum
from handpipe.fem.solver.attempts import minimum

log = logging.getLogger(__name__)

ROUNDS = 200  # moves at most
STALLED = 1e-4  # of what remains: a round that moves less has not moved
STALLED_ROUNDS = 5  # in a row without motion, after which it ends
RELAXATIONS = 4  # Newton iterations between two moves
TOLERANCE = 1e-3  # relative error of a move's linear solve


def approach(
    potentials: Sequence[Potential],
    barrier: Barrier,
    x: Array,
    vertices: Array,
    *,
    fixed: BoolArray | None = None,
    target: Array | None = None,
    options: Options | None = None,
) -> tuple[Equilibrium, Barrier]:
    """Equilibrium with obstacle and fixed vertices at new places, reached without intersections.

    In each round the body follows the prescribed motion to first order, both move as far as continuous
    collision detection allows, and the body relaxes. A few rounds cover many activation distances, since the
    obstacle pushes along what it touches. Vertices move on straight lines: rotate an obstacle in small steps.

    Parameters
    ----------
    potentials : sequence of Potential
        All potentials but the barrier.
    barrier : Barrier
        Barrier with the obstacle at its old place.
    x : array (n, 3)
        Positions in mm at or near the equilibrium with that barrier.
    vertices : array (o, 3)
        New positions of the obstacle's vertices in mm.
    fixed : boolean array (3n,), optional
        Mask of the fixed degrees of freedom; by default none.
    target : array (n, 3), optional
        New positions in mm, whose fixed degrees of freedom apply; by default x.
    options : Options, optional
        When to stop, and what to do where that fails.

    Returns
    -------
    equilibrium : Equilibrium
        Positions in mm and the record of the last solve.
    barrier : Barrier
        Barrier with the obstacle at its new place.

    Raises
    ------
    ConvergenceError
        If obstacle and fixed vertices cannot come nearer to their places without intersections, or the last
        solve finds no minimum (unless `options.allow_partial`).
    InputError
        If x is not finite.
    """
    options = options or Options()
    brief = replace(options, allow_partial=True, max_iterations=RELAXATIONS)
    free = np.ones(x.size, dtype=bool) if fixed is None else ~np.asarray(fixed, dtype=bool).ravel()
    aim = x if target is None else target
    x, idle, workspace, energy = (
        finite(x, options.name),
        0,
        Workspace(x, options.coarse, options.single),
        Sum([*potentials, barrier]),
    )
    for number in range(ROUNDS):
        motion = np.where(free.reshape(x.shape), 0.0, aim - x)
        step = _follow(energy, barrier, x, motion, vertices - barrier.obstacle, free, workspace)
        fraction, moved = barrier.advance(x, step, vertices)
        x = x + fraction * step
        log.info("%s: round %d covers %.3g of the remaining motion", options.name, number + 1, fraction)
        if moved is not barrier:
            barrier, energy = moved, Sum([*potentials, moved])
        if fraction == 1.0:
            return minimum(energy, x, free, options, workspace), barrier
        idle = idle + 1 if fraction < STALLED else 0
        if idle == STALLED_ROUNDS:
            break
        x = minimum(energy, x, free, brief, workspace).x
    raise ConvergenceError(options.name, "what is prescribed cannot come nearer to its place without cutting")


def _follow(
    energy: Sum,
    barrier: Barrier,
    x: Array,
    motion: Array,
    shift: Array,
    free: BoolArray,
    workspace: Workspace,
) -> Array:
    """Step (n, 3) that makes the prescribed motions and keeps equilibrium to first order.

    With the projected Hessian: near an instability the plain one, even where it is definite, leads far away.
    """
    matrix = energy.hessian(x, True)
    change = energy.gradient(x) + barrier.drag(x, shift)
    load = change.ravel() + matrix @ motion.ravel()
    step = motion.ravel().copy()
    try:
        block = workspace.block(matrix, free)
        step[free] -= workspace.systems.solve(block, load[free], tolerance=TOLERANCE, free=free)
    except (NotPositiveDefinite, SingularMatrix):
        log.debug("the tangent cannot be factorised: only obstacle and fixed vertices move")
    return step.reshape(x.shape)
