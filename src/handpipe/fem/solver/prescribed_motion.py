"""Moving what is prescribed, obstacles and fixed vertices, to its new place without ever intersecting."""

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

ROUNDS = 200
STALLED = 1e-4  # of what remains: a round that moves less has not moved
STALLED_ROUNDS = 5
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
    """Equilibrium with the obstacle at `vertices` (o, 3), `fixed` degrees of freedom at `target` (n, 3).

    x (n, 3) is (near) the equilibrium with `barrier` as given, `potentials` are all others, `fixed` a mask
    (3n,). In each round the body follows the prescribed motion to first order, both move as far as continuous
    collision detection finds free, and the body relaxes; a few rounds lead through many activation
    distances, since what is touched is pushed along. Vertices move on straight lines: turn an obstacle in
    small steps. Returns the equilibrium and the barrier there; raises `ConvergenceError` where nothing moves.
    """
    options = options or Options()
    brief = replace(options, allow_partial=True, max_iterations=RELAXATIONS)
    free = np.ones(x.size, dtype=bool) if fixed is None else ~np.asarray(fixed, dtype=bool).ravel()
    aim = x if target is None else target
    x, idle, workspace, energy = (
        finite(x, options.name),
        0,
        Workspace(x, options.coarse),
        Sum([*potentials, barrier]),
    )
    for number in range(ROUNDS):
        motion = np.where(free.reshape(x.shape), 0.0, aim - x)
        step = _follow(energy, barrier, x, motion, vertices - barrier.obstacle, free, workspace)
        fraction, moved = barrier.advance(x, step, vertices)
        x = x + fraction * step
        log.info("%s: round %d moves by %.3g of what remains", options.name, number + 1, fraction)
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
        log.debug("the tangent cannot be factorised: only what is prescribed moves")
    return step.reshape(x.shape)
