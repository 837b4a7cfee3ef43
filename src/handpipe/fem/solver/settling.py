"""Equilibria whose contact planes are taken anew until the shape rests."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from handpipe.core import Array, ConvergenceError

log = logging.getLogger(__name__)

CONTRACTING = 0.9  # of the motion before: a motion larger than this does not die away
LEAST_SHARE = 0.25  # of a motion that is carried out, at least


@dataclass(frozen=True)
class Limits:
    """Limits of the renewal of contact planes.

    Parameters
    ----------
    renewals : int
        Renewals of the contact planes, at most.
    settled, gross : float
        Motion in mm from where the planes were taken: below `settled` they need no renewal, above `gross`
        there is no result.
    """

    renewals: int
    settled: float
    gross: float


@dataclass(frozen=True)
class Settled:
    """An equilibrium, and how well its contact planes fit it.

    Attributes
    ----------
    x : (n, 3)
        Positions.
    renewals : int
        How often contact planes were taken.
    motion : float
        Motion in mm from where the planes of x were taken.
    rests : bool
        Whether that motion is little enough.
    chosen : int
        The number of the equilibrium that x is, from one.
    solver : mapping of str to float
        What the solver said of it, by name.
    """

    x: Array
    renewals: int
    motion: float
    rests: bool = True
    chosen: int = 0
    solver: Mapping[str, float] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, float]:
        """What an artifact keeps of it, by name; the motion is in mm."""
        renewals, unsettled = float(self.renewals), float(not self.rests)
        return {"contact_renewals": renewals, "contact_motion": self.motion, "contact_unsettled": unsettled}

    @property
    def validity(self) -> dict[str, float]:
        """Whether a frame's body may be trusted, by name: motion in mm, and what the solver said."""
        return {"unsettled": float(not self.rests), "contact_motion": self.motion, **self.solver}


def largest(motion: Array) -> float:
    """The longest vector of a motion (n, 3)."""
    return float(np.linalg.norm(motion, axis=1).max())


def root_mean_square(motion: Array) -> float:
    """Of the lengths of a motion's vectors (n, 3)."""
    return float(np.sqrt((motion**2).sum(axis=1).mean()))


def settle(
    equilibrium: Callable[[Array], Array],
    x: Array,
    limits: Limits,
    name: str,
    measure: Callable[[Array], float] = largest,
    mover: Callable[[Array], str] | None = None,
) -> Settled:
    """The equilibrium (n, 3) whose contact planes were taken where it is itself: a fixed point.

    equilibrium: from positions (n, 3) where planes are taken to the equilibrium under them; x: where to
    begin; measure: mm of a motion (n, 3); mover: names what a motion moves most. Planes that alternate
    between facets would keep the shape in a cycle: where the motion turns back and does not die away, only a
    share of it is carried out before planes are taken again; one that goes on is a long way. Of a shape that
    does not settle a warning is logged, and the equilibrium of least motion is taken. Raises
    `ConvergenceError` where that is above `limits.gross`.
    """
    share, before, last = 1.0, np.inf, np.zeros_like(x)
    best = Settled(x, 0, np.inf)
    for count in range(1, limits.renewals + 1):
        found = equilibrium(x)
        step = found - x
        motion = measure(step)
        moved = "" if mover is None else f", most of all {mover(step)}"
        log.info("%s: contact planes taken %d times, motion %.3f mm%s", name, count, motion, moved)
        if motion < best.motion:
            best = Settled(found, count, motion, chosen=count)
        if motion < limits.settled:
            return best
        if motion > CONTRACTING * before:
            turns_back = np.vdot(step, last) < 0
            share = max(0.5 * share, LEAST_SHARE) if turns_back else min(2 * share, 1.0)
        x, before, last = x + share * step, motion, step
    if best.motion > limits.gross:
        reason = f"it moves by {best.motion:.2f} mm at least in {count} renewals of its contact planes{moved}"
        raise ConvergenceError(name, reason)
    log.warning("%s: not settled, motion %.3f mm in %d renewals", name, best.motion, count)
    return replace(best, renewals=count, rests=False)
