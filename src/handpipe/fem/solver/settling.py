"""Equilibria whose contact planes are updated until the shape no longer moves."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from handpipe.core import Array, ConvergenceError
from handpipe.fem.minimisation import Equilibrium

log = logging.getLogger(__name__)

CONTRACTING = 0.9  # of the motion before: a motion larger than this does not die away
LEAST_SHARE = 0.25  # of a motion that is carried out, at least
EARLY = 4  # one in so many renewals, the first ones, may end early
CLEARLY, ROUGHLY = 1.2, 0.5  # of the settled motion: above and below it, see `NearEnough`


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

    Parameters
    ----------
    x : array (n, 3)
        Positions in mm.
    renewals : int
        Number of times that contact planes were taken.
    motion : float
        Motion in mm of x from the positions where its planes were taken.
    rests : bool
        Whether that motion is below the limit.
    chosen : int
        Which of the equilibria x is, counted from one.
    solver : mapping of str to float
        The solver's figures for it, by name.
    """

    x: Array
    renewals: int
    motion: float
    rests: bool = True
    chosen: int = 0
    solver: Mapping[str, float] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, float]:
        """Figures for an artifact, by name; the motion is in mm."""
        renewals, unsettled = float(self.renewals), float(not self.rests)
        return {"contact_renewals": renewals, "contact_motion": self.motion, "contact_unsettled": unsettled}

    @property
    def validity(self) -> dict[str, float]:
        """Figures by which a frame's body is judged, by name: motion in mm, and the solver's own."""
        return {"unsettled": float(not self.rests), "contact_motion": self.motion, **self.solver}


@dataclass
class NearEnough:
    """Tells a solve that it may end where its planes will be taken anew: exactness would be lost there.

    So it is where the shape has clearly left the positions at which the planes were taken, and the last step
    was small.

    Parameters
    ----------
    planes : array (n, 3)
        Positions in mm at which the planes were taken.
    settled : float
        Motion in mm below which planes need no renewal.
    measure : callable
        From a motion (n, 3) in mm to its size in mm.
    told : bool
        Whether some solve was told that it may end.
    """

    planes: Array
    settled: float
    measure: Callable[[Array], float]
    told: bool = False

    def __call__(self, x: Array, step: Array) -> bool:
        """Whether x (n, 3) is near enough after a step (n, 3)."""
        leaves = self.measure(x - self.planes) > CLEARLY * self.settled
        near = bool(leaves and self.measure(step) < ROUGHLY * self.settled)
        self.told = self.told or near
        return near


def largest(motion: Array) -> float:
    """Largest length of a motion's vectors.

    Parameters
    ----------
    motion : array (n, 3)
        Displacements, here in mm.

    Returns
    -------
    float
        Length in the same unit.
    """
    return float(np.linalg.norm(motion, axis=1).max())


def root_mean_square(motion: Array) -> float:
    """Root mean square of the lengths of a motion's vectors.

    Parameters
    ----------
    motion : array (n, 3)
        Displacements, here in mm.

    Returns
    -------
    float
        Length in the same unit.
    """
    return float(np.sqrt((motion**2).sum(axis=1).mean()))


def settle(
    solve: Callable[[Array, NearEnough | None], Equilibrium],
    x: Array,
    limits: Limits,
    name: str,
    measure: Callable[[Array], float] = largest,
    mover: Callable[[Array], str] | None = None,
    parts: Sequence[slice] = (slice(None),),
) -> Settled:
    """Equilibrium under contact planes that were taken at the equilibrium itself: a fixed point.

    Planes that alternate between facets would keep the shape in a cycle. Where the motion of a part does not
    decay and reverses, only a share of it is made before planes are taken again; where it goes on, the share
    grows. Each part has its own share: one that alternates is damped while another moves on.

    Parameters
    ----------
    solve : callable
        From positions (n, 3) in mm where planes are taken to the equilibrium under these planes.
        It may end early where its second argument, if not None, says so: at the first quarter of all
        renewals, where planes are still far from those of the result. One that does is made up for by a
        further renewal.
    x : array (n, 3)
        Positions in mm where the first planes are taken.
    limits : Limits
        Number of renewals, and bounds on the motion in mm.
    name : str
        Name of the shape in log lines and errors.
    measure : callable
        From a motion (n, 3) in mm to its size in mm.
    mover : callable, optional
        From a motion (n, 3) to the name of what moves most, for log lines.
    parts : sequence of slice
        Rows of x by body; all bodies together have every row once.

    Returns
    -------
    Settled
        The first equilibrium whose motion is below `limits.settled`; else, after a warning, the one of least
        motion.

    Raises
    ------
    ConvergenceError
        If the least motion is above `limits.gross`.
    """
    shares, before, last = np.ones(len(parts)), np.full(len(parts), np.inf), np.zeros_like(x)
    best, count, most = Settled(x, 0, np.inf), 0, limits.renewals
    while count < most:
        count += 1
        early = NearEnough(x, limits.settled, measure) if count <= limits.renewals // EARLY else None
        found = solve(x, early)
        step = found.x - x
        motion = measure(step)
        moved = "" if mover is None else f", most of all {mover(step)}"
        log.info("%s: contact planes renewed %d times, last motion %.3f mm%s", name, count, motion, moved)
        exact = early is None or not early.told
        most += not exact
        if exact and motion < best.motion:
            best = Settled(found.x, count, motion, chosen=count, solver=found.record.figures)
        if exact and motion < limits.settled:
            return best
        motions = np.array([measure(step[part]) for part in parts])
        shares = np.where(
            (motions >= limits.settled) & (motions > CONTRACTING * before),
            _changed(shares, [bool(np.vdot(step[part], last[part]) < 0) for part in parts]),
            shares,
        )
        x, before, last = x.copy(), motions, step
        for part, share in zip(parts, shares, strict=True):
            x[part] += share * step[part]
    if best.motion > limits.gross:
        reason = f"it moves by {best.motion:.2f} mm at least in {count} renewals of its contact planes{moved}"
        raise ConvergenceError(name, reason)
    log.warning("%s: not settled, motion %.3f mm in %d renewals", name, best.motion, count)
    return replace(best, renewals=count, rests=False)


def _changed(shares: Array, turns_back: Sequence[bool]) -> Array:
    """Shares of motions that do not decay: less of one that turns back, more of one that goes on."""
    return np.where(turns_back, np.maximum(0.5 * shares, LEAST_SHARE), np.minimum(2 * shares, 1.0))
