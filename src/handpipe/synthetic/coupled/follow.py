"""Following a body's equilibrium as its bones move and its muscles tense."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from handpipe.core import Array
from handpipe.fem.minimisation import Record
from handpipe.fem.solver import Equilibrium, Options, Steps, approach, continuation, solve
from handpipe.synthetic.coupled.coupled_body import CoupledBody, CoupledPose
from handpipe.synthetic.coupled.uninverted import uninverted

log = logging.getLogger(__name__)

REACH = 3.0  # of contact on the way, in activation distances: the skin is pushed along in longer rounds
PASSING = 8  # iterations for an intermediate state, which need not converge
NO_OBSTACLE = np.zeros((0, 3))


def follow(
    body: CoupledBody,
    motion: Callable[[float], CoupledPose],
    x: Array | None = None,
    *,
    steps: int = 4,
    options: Options | None = None,
) -> Equilibrium:
    """The equilibrium at motion(1), followed from x (n, 3), that of motion(0), by default the rest shape.

    Without contact steps are as long as the solver can take, the first one of `steps`; with contact there are
    so many, each walked as far as is free of collisions.

    Raises
    ------
    ConvergenceError
        If no equilibrium is found, or tissue stays inverted.
    """
    options = options or Options(name="coupled body")
    start = body.rest if x is None else x
    way = _without_contact if body.barrier is None else _with_contact
    return uninverted(body, body.energies(motion(1.0)), way(body, motion, start, steps, options), options)


def _without_contact(
    body: CoupledBody, motion: Callable[[float], CoupledPose], start: Array, steps: int, options: Options
) -> Equilibrium:
    return continuation(
        lambda t: body.potentials(motion(t)),
        start,
        fixed=body.fixed,
        prescribed=lambda t: body.prescribed(motion(t), start),
        options=options,
        steps=Steps(first=1.0 / steps, largest=2.0 / steps),
    )


def _with_contact(
    body: CoupledBody, motion: Callable[[float], CoupledPose], start: Array, steps: int, options: Options
) -> Equilibrium:
    """On the way contact acts from further off, and no step ends in equilibrium: the last one alone does."""
    assert body.barrier is not None
    barrier, x = body.barrier.reaching(REACH * body.barrier.distance), start
    passing, record = replace(options, allow_partial=True, max_iterations=PASSING), Record()
    for number in range(steps):
        pose = motion((number + 1) / steps)
        found, _ = approach(
            body.potentials(pose),
            barrier,
            x,
            NO_OBSTACLE,
            fixed=body.fixed,
            target=body.prescribed(pose, x),
            options=passing,
        )
        x = found.x
        record.add(found.record)
        log.info("%s: step %d of %d, gap %.3g mm", options.name, number + 1, steps, body.barrier.gap(x))
    found = solve(body.energies(motion(1.0)), x, fixed=body.fixed, options=options)
    record.add(found.record)
    return Equilibrium(found.x, record)
