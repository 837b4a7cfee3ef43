"""Static equilibria of sums of potentials: one at a time, or followed as a load grows."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array, BoolArray, ConvergenceError, InputError
from handpipe.fem.minimisation.checkpoint import Checkpoint
from handpipe.fem.minimisation.record import Equilibrium, Options, Record, finite
from handpipe.fem.minimisation.workspace import Workspace
from handpipe.fem.potentials.potential import Potential, Sum
from handpipe.fem.solver.attempts import Attempts, minimum
from handpipe.fem.solver.prediction import predict

__all__ = ["Analyses", "Equilibrium", "Options", "Record", "Steps", "continuation", "solve"]

log = logging.getLogger(__name__)

TANGLED_STEP = 1 / 8  # of the first step: above it, a step that ends tangled is halved
EASY = 6  # iterations: a step that needs no more is doubled


class Analyses:
    """Symbolic analyses of linear systems, kept from solve to solve.

    They depend on sparsity patterns alone: no result depends on whether they were kept.
    """

    def __init__(self) -> None:
        self._last: Workspace | None = None

    def workspace(self, x: Array, options: Options) -> Workspace:
        """A workspace for a solve from x (n, 3), with the analyses of the last one."""
        self._last = Workspace(x, options.coarse, options.single, self._last)
        return self._last


def solve(
    potentials: Sequence[Potential],
    x: Array,
    *,
    fixed: NDArray | None = None,
    options: Options | None = None,
    checkpoint: Checkpoint | None = None,
    analyses: Analyses | None = None,
) -> Equilibrium:
    """Equilibrium that minimises a sum of potentials, near an initial guess.

    Rigid-body modes that no potential resists are pinned. Fix vertices at their final positions, and let
    `continuation` make large moves in steps.

    Parameters
    ----------
    potentials : sequence of Potential
        Potentials whose sum is minimised.
    x : array (n, 3)
        Initial guess in mm; fixed degrees of freedom keep their values in it.
    fixed : boolean array (3n,) or (n, 3), or integer array, optional
        Mask or indices of the fixed degrees of freedom; by default none.
    options : Options, optional
        When to stop, and what to do where that fails.
    checkpoint : Checkpoint, optional
        File of states, from which an interrupted solve continues.
    analyses : Analyses, optional
        Symbolic analyses that solves of the same sparsity pattern share.

    Returns
    -------
    Equilibrium
        Positions in mm and the record of the solve.

    Raises
    ------
    ConvergenceError
        If no minimum is found, unless `options.allow_partial`.
    InputError
        If x is not finite, or a mask has another size.
    """
    options = options or Options()
    x, free = finite(x, options.name), _free(fixed, x.size)
    energy = Sum(potentials)
    if checkpoint is not None:
        earlier = checkpoint.begin(options.name, x, free, energy.value(x))
        if earlier is not None:
            log.info("%s: continuing from %s", options.name, checkpoint.path)
            x = earlier[2]
    workspace = (analyses or Analyses()).workspace(x, options)
    found = minimum(energy, x, free, options, workspace, checkpoint)
    if checkpoint is not None:
        checkpoint.done()
    return found


@dataclass(frozen=True)
class Steps:
    """Steps of a load from t = 0 to 1.

    Parameters
    ----------
    first, smallest, largest : float
        Lengths of steps in t; at failures below `smallest` the continuation ends.
    intermediate : Options, optional
        Options of the equilibria before t = 1, which may be less exact; by default those of the last.
    """

    first: float = 0.25
    smallest: float = 1 / 256
    largest: float = 1.0
    intermediate: Options | None = None


def continuation(
    make_potentials: Callable[[float], Sequence[Potential]],
    x: Array,
    *,
    fixed: NDArray | None = None,
    prescribed: Callable[[float], Array] | None = None,
    options: Options | None = None,
    steps: Steps | None = None,
    checkpoint: Checkpoint | None = None,
) -> Equilibrium:
    """Equilibrium at the end of a load, which is followed from t = 0 to 1.

    Each step starts from a prediction with the last tangent stiffness; a step that fails is halved, one that
    converges easily is doubled, within the bounds of `steps`.

    Parameters
    ----------
    make_potentials : callable
        From t to the potentials.
    x : array (n, 3)
        Positions in mm at or near the equilibrium at t = 0.
    fixed : boolean array (3n,) or (n, 3), or integer array, optional
        Mask or indices of the fixed degrees of freedom; by default none.
    prescribed : callable, optional
        From t to positions (n, 3) in mm, whose fixed degrees of freedom apply; by default they stay as in x.
    options : Options, optional
        When to stop, and what to do where that fails.
    steps : Steps, optional
        Lengths of the steps.
    checkpoint : Checkpoint, optional
        File of states, from which an interrupted run continues.

    Returns
    -------
    Equilibrium
        Positions in mm at t = 1, or the last equilibrium reached if `options.allow_partial`; the record of
        all steps.

    Raises
    ------
    ConvergenceError
        If a step fails below the smallest length, unless `options.allow_partial`.
    InputError
        If x is not finite, or a mask has another size.
    """
    options, steps = options or Options(), steps or Steps()
    path = _Path(make_potentials, prescribed, _free(fixed, x.size), options, steps.intermediate or options)
    return path.follow(finite(x, options.name), steps.first, (steps.smallest, steps.largest), checkpoint)


class _Path:
    """Equilibria along a load, with one sequence of linear systems for all of them."""

    def __init__(
        self,
        make_potentials: Callable[[float], Sequence[Potential]],
        prescribed: Callable[[float], Array] | None,
        free: BoolArray,
        options: Options,
        intermediate: Options,
    ) -> None:
        self.make_potentials, self.prescribed, self.free = make_potentials, prescribed, free
        self.options = replace(options, allow_partial=True)
        self.intermediate = replace(intermediate, allow_partial=True, name=options.name)
        self.allow_partial = options.allow_partial
        self.record = Record()
        self.missed: list[tuple[float, Array]] = []  # by the last predictions: middle of step, miss / step^2

    def follow(
        self, x: Array, step: float, bounds: tuple[float, float], checkpoint: Checkpoint | None
    ) -> Equilibrium:
        """Positions at t = 1, or the last ones reached where the options allow that."""
        self.workspace = Workspace(x, self.options.coarse, self.options.single)
        t, first, knots, started = 0.0, step, 0, time.perf_counter()
        if checkpoint is not None:
            t, step, x = self._take_up(x, step, checkpoint)
        while t < 1.0:
            step = min(step, 1.0 - t)
            found = self._advance(x, t + step, step, knots, checkpoint)
            self.record.add(found.record)
            tangled = found.record.tangles > knots and step > TANGLED_STEP * first
            if tangled or not found.record.converged:
                reason = f"{found.record.tangles} tangles" if tangled else found.record.reason
                log.info("%s: t = %.4f failed (%s), halving", self.options.name, t + step, reason)
                step *= 0.5
                if step < bounds[0]:
                    return self._give_up(x, t, found.record.reason)
                continue
            t, x, knots = t + step, found.x, found.record.tangles
            if found.record.iterations <= EASY:
                step = min(2.0 * step, bounds[1])
            elapsed = time.perf_counter() - started
            log.info(
                "%s: t = %.4f after %d iterations, about %.0f s left",
                self.options.name,
                t,
                found.record.iterations,
                elapsed / t * (1.0 - t),
            )
        if checkpoint is not None:
            checkpoint.done()
        return Equilibrium(x, self.record)

    def _advance(
        self, x: Array, t: float, step: float, knots: int, checkpoint: Checkpoint | None
    ) -> Equilibrium:
        """Solve at t from a prediction out of x, the equilibrium one step before with `knots` tangles."""
        energy = Sum(self.make_potentials(t))
        target = x if self.prescribed is None else self.prescribed(t)
        begun = time.perf_counter()
        tangent = predict(energy, x, target, self.free, self.workspace)
        start = self._corrected(energy, tangent, t, step)
        self.record.seconds["linear"] += time.perf_counter() - begun
        if checkpoint is not None:
            checkpoint.at(t, step)
        found = self._minimise(energy, start, t, knots, checkpoint)
        missed = (t - 0.5 * step, (found.x - tangent) / step**2)
        self.missed = [*self.missed[-1:], missed] if found.record.converged else []
        return found

    def _corrected(self, energy: Sum, tangent: Array, t: float, step: float) -> Array:
        """The tangent's prediction corrected by its errors in the last steps, where that lowers the energy.

        Its error grows with the square of the step and changes slowly along the path: linearly, where two
        errors are known.
        """
        if not self.missed:
            return tangent
        at, change = self.missed[-1]
        if len(self.missed) > 1:
            before, earlier = self.missed[0]
            change = change + (t - 0.5 * step - at) / (at - before) * (change - earlier)
        moved = tangent + step**2 * change
        return moved if energy.value(moved) < energy.value(tangent) else tangent

    def _minimise(
        self, energy: Sum, x: Array, t: float, knots: int, checkpoint: Checkpoint | None
    ) -> Equilibrium:
        options = self.options if t >= 1.0 else self.intermediate
        return Attempts(energy, x, self.free, options, self.workspace, checkpoint).best(knots)

    def _take_up(self, x: Array, step: float, checkpoint: Checkpoint) -> tuple[float, float, Array]:
        """Load, step and positions to start from: those of an earlier run of the same problem, if any."""
        at_rest = Sum(self.make_potentials(0.0)).value(x)
        loaded = Sum(self.make_potentials(1.0)).value(x)
        target = x if self.prescribed is None else self.prescribed(1.0)
        earlier = checkpoint.begin(self.options.name, x, self.free, at_rest, loaded, np.asarray(target))
        if earlier is None:
            return 0.0, step, x
        t, step, state = earlier
        log.info("%s: continuing at t = %.4f from %s", self.options.name, t, checkpoint.path)
        checkpoint.at(t, step)
        found = self._minimise(Sum(self.make_potentials(t)), state, t, 0, checkpoint)
        self.record.add(found.record)
        return (t, step, found.x) if found.record.converged else (0.0, step, x)

    def _give_up(self, x: Array, t: float, reason: str) -> Equilibrium:
        self.record.converged = False
        self.record.reason = f"no equilibrium beyond t = {t:.4f}; last attempt: {reason}"
        if self.allow_partial:
            return Equilibrium(x, self.record)
        raise ConvergenceError(self.options.name, self.record.reason)


def _free(fixed: NDArray | None, size: int) -> BoolArray:
    """Mask (3n,) of the unknowns."""
    free = np.ones(size, dtype=bool)
    if fixed is None:
        return free
    array = np.asarray(fixed)
    if array.dtype == bool:
        if array.size != size:
            raise InputError(
                "equilibrium", "fixed", f"has {array.size} entries, not {size}", "Give a mask (3n,)"
            )
        return ~array.ravel()
    free[array.ravel()] = False
    return free
