"""Starts whose surfaces nearly touch are opened before a solve.

A logarithmic barrier's stiffness grows with the inverse square of the gap. At gaps far below the activation
distance it hides all other stiffness from the arithmetic, and Newton's method only doubles the gap in each
step.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from handpipe.core import Array, BoolArray
from handpipe.fem.minimisation.balance import lengths
from handpipe.fem.potentials.potential import Sum

log = logging.getLogger(__name__)

NEARLY = 1e-3  # of the activation distance: surfaces nearer than this are opened
MOVE = 1e-2  # of the activation distance, in one round
WEAK = 1e-3  # of the largest contact force: vertices with more are moved by as much
ROUNDS = 30  # of motion along the forces, at most


def opened(energy: Sum, x: Array, free: BoolArray, name: str) -> Array:
    """Positions (n, 3) near x whose gaps are a thousandth of the barriers' activation distance at least.

    Vertices move along the barrier's forces, as far as contact allows; fixed degrees of freedom (those not
    in the mask `free` (3n,)) stay, and gaps between these with them.
    """
    barriers: list[Any] = [p for p in energy.potentials if hasattr(p, "gap")]
    for barrier in barriers:
        narrow = NEARLY * barrier.distance
        before = gap = barrier.gap(x)
        for _ in range(ROUNDS):
            force = -np.where(free.reshape(-1, 3), barrier.gradient(x), 0.0)
            sizes = lengths(force)
            if gap >= narrow or not sizes.any() or not np.isfinite(sizes).all():
                break
            scale = np.maximum(sizes, WEAK * sizes.max())
            step = MOVE * barrier.distance * force / scale[:, None]
            x = x + energy.max_step(x, step) * step
            gap = barrier.gap(x)
        if before < narrow:
            log.info("%s: opened the initial gap of %.2g mm to %.2g mm", name, before, gap)
    return x
