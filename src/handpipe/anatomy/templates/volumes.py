"""Scales of tissue functions by which muscles get the volumes that they are to have."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import numpy as np

from handpipe.core import Array, ConvergenceError

log = logging.getLogger(__name__)

TOLERANCE = 0.01  # of a volume: the error at which the search ends
ROUNDS = 25  # of the search, at most
FIRST_POWER = 1.5  # initial guess: volume is proportional to this power of the scale
POWERS = (0.3, 12.0)  # least and largest power that a measured one is bounded by
LONGEST_STEP = 0.5  # of the logarithm of a scale
DECIMALS = 6  # of scales: beyond them machines differ, and each cut of the mesh amplifies the difference
TOLD = 1e-4  # change of a scale that measures the power


def meet_volumes(
    targets: Array,
    volumes_of: Callable[[Array], Array],
    names: Sequence[str],
    *,
    tolerance: float = TOLERANCE,
) -> Array:
    """Scales of tissue functions for which muscles have their target volumes.

    Each scale goes by its own secant of log volume over log scale. Neighbours change, too; the next round
    corrects them.

    Parameters
    ----------
    targets : array (k,)
        Volumes in mm^3; NaN leaves a scale at one.
    volumes_of : callable
        Volumes (k,) in mm^3 for scales (k,).
    names : sequence of str
        Names of the tissues, for messages.
    tolerance : float
        Largest relative difference of a volume from its target.

    Returns
    -------
    array (k,)
        Scales.

    Raises
    ------
    ConvergenceError
        Where the volumes are not met, for lack of room, say. The text names the tissue that is farthest off.
    """
    wanted = np.flatnonzero(np.isfinite(targets))
    scale = np.zeros(len(targets))
    power = np.full(len(targets), FIRST_POWER)
    before: tuple[Array, Array] | None = None
    for number in range(ROUNDS):
        scales = np.exp(scale).round(DECIMALS)
        volume = np.log(np.maximum(volumes_of(scales), 1e-9))
        lack = np.where(np.isfinite(targets), np.log(np.where(np.isfinite(targets), targets, 1)) - volume, 0)
        log.info("round %d: volumes off by %s", number, np.round(np.expm1(-lack[wanted]), 3))
        if np.abs(lack).max(initial=0) <= np.log1p(tolerance):
            return scales
        if before is not None:
            change = scale - before[0]
            moved = np.abs(change) > TOLD
            power[moved] = np.clip(((volume - before[1])[moved] / change[moved]), *POWERS)
        before = scale.copy(), volume
        scale = scale + np.clip(lack / power, -LONGEST_STEP, LONGEST_STEP)
    worst = int(np.argmax(np.abs(lack)))
    raise ConvergenceError(
        f"the volume of {names[worst]}",
        f"{np.exp(volume[worst]):.4g} mm^3 after {ROUNDS} rounds, not {targets[worst]:.4g}",
        "Ask for another volume, give it a shorter edge_length, or move curves apart.",
    )
