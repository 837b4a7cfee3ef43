"""Moving what is prescribed, obstacles and fixed vertices, to its new place without ever intersecting."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handpipe.errors import ConvergenceError
from handpipe.fem.barrier import Barrier
from handpipe.fem.equilibrium import Equilibrium, Options, solve
from handpipe.fem.linear import NotPositiveDefinite, SingularMatrix, factorise
from handpipe.fem.potential import Potential, Sum
from handpipe.fem.reduction import FreeBlock

Array = NDArray[np.float64]
log = logging.getLogger(__name__)

ROUNDS = 200
STALLED = 1e-4  # of what remains: a round that moves less has not moved
STALLED_ROUNDS = 5
RELAXATIONS = 4  # Newton iterations between two moves


def approach(
    potentials: Sequence[Potential],
    barrier: Barrier,
    x: Array,
    vertices: Array,
    *,
    fixed: NDArray[np.bool_] | None = None,
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
    x, idle = np.array(x, dtype=float), 0
    for number in range(ROUNDS):
        motion = np.where(free.reshape(x.shape), 0.0, aim - x)
        step = _follow(potentials, barrier, x, motion, vertices - barrier.obstacle, free)
        fraction, barrier = barrier.advance(x, step, vertices)
        x = x + fraction * step
        log.info("%s: round %d moves by %.3g of what remains", options.name, number + 1, fraction)
        if fraction == 1.0:
            return solve([*potentials, barrier], x, fixed=~free, options=options), barrier
        idle = idle + 1 if fraction < STALLED else 0
        if idle == STALLED_ROUNDS:
            break
        x = solve([*potentials, barrier], x, fixed=~free, options=brief).x
    raise ConvergenceError(options.name, "what is prescribed cannot come nearer to its place without cutting")


def _follow(
    potentials: Sequence[Potential],
    barrier: Barrier,
    x: Array,
    motion: Array,
    shift: Array,
    free: NDArray[np.bool_],
) -> Array:
    """Step (n, 3) that makes the prescribed motions and keeps equilibrium to first order."""
    energy = Sum([*potentials, barrier])
    matrix = energy.hessian(x, True)
    change = energy.gradient(x) + barrier.drag(x, shift)
    load = change.ravel() + matrix @ motion.ravel()
    step = motion.ravel().copy()
    try:
        step[free] -= factorise(FreeBlock(matrix, free).matrix(matrix)).solve(load[free])
    except (NotPositiveDefinite, SingularMatrix):
        log.debug("the tangent cannot be factorised: only what is prescribed moves")
    return step.reshape(x.shape)
