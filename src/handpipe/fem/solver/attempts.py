"""Solution methods near a shape, tried in turn until one ends without tangles."""

from __future__ import annotations

import logging
from collections.abc import Iterator

from handpipe.core import Array, BoolArray, ConvergenceError
from handpipe.fem.elements.crushing import CRUSHED, STEEPEST, Crushing
from handpipe.fem.elements.validity import Validity
from handpipe.fem.minimisation.checkpoint import Checkpoint
from handpipe.fem.minimisation.newton import Newton
from handpipe.fem.minimisation.record import Equilibrium, Options, Record
from handpipe.fem.minimisation.workspace import Workspace
from handpipe.fem.potentials.elastic import Elastic
from handpipe.fem.potentials.potential import Sum
from handpipe.fem.solver.untangling import (
    by_stand_in,
    from_rest,
    inverted,
    least_volume,
    nearly_incompressible,
    tangles,
    uncrushed,
    with_barrier,
)

log = logging.getLogger(__name__)


def minimum(
    energy: Sum,
    x: Array,
    free: BoolArray,
    options: Options,
    workspace: Workspace,
    checkpoint: Checkpoint | None = None,
) -> Equilibrium:
    """The best minimum near x (n, 3). `ConvergenceError` without one, unless `options.allow_partial`."""
    found = Attempts(energy, x, free, options, workspace, checkpoint).best()
    if not found.record.converged and not options.allow_partial:
        raise ConvergenceError(options.name, found.record.reason)
    return found


class Attempts:
    """The minimisations of `energy` from x (n, 3) over the mask `free` (3n,)."""

    def __init__(
        self,
        energy: Sum,
        x: Array,
        free: BoolArray,
        options: Options,
        workspace: Workspace,
        checkpoint: Checkpoint | None = None,
    ) -> None:
        self.energy, self.x, self.free = energy, x, free
        self.options, self.workspace, self.checkpoint = options, workspace, checkpoint
        self.record = Record()

    def best(self, accepted: int = 0) -> Equilibrium:
        """The first minimum with at most `accepted` tangles, else the converged shape with the fewest."""
        best: Newton | None = None
        for newton in self._ways():
            self.record.add(newton.record)
            if not newton.record.converged and best is not None:
                continue
            newton.record.tangles = tangles(self.energy, newton.x)
            if best is None or _worth(newton) > _worth(best):
                best = newton
            fine = newton.record.tangles <= accepted or not self.options.untangle
            if newton.record.converged and fine:
                break
            log.info("%s: %s with %d tangles", self.options.name, newton.record.reason, newton.record.tangles)
        assert best is not None
        if self.options.barrier:
            best = self._uncrushed(best)
        for name in ("converged", "reason", "tangles"):
            setattr(self.record, name, getattr(best.record, name))
        if best.record.tangles > accepted:
            log.warning("%s: %d tangles are left", self.options.name, best.record.tangles)
        return Equilibrium(best.x, self.record)

    def _uncrushed(self, found: Newton) -> Newton:
        """The minimum with the barrier on volume, where the one found has tets that the barrier acts on."""
        resisted = any(isinstance(p, Crushing) for p in found.energy.potentials)
        if resisted or not found.record.converged or least_volume(self.energy, found.x) >= CRUSHED:
            return found
        newton = uncrushed(self.energy, found.x, self.free, self.options, self.workspace)
        self.record.add(newton.record)
        newton.record.tangles = tangles(self.energy, newton.x)
        if inverted(self.energy, newton.x):
            newton.record.converged, newton.record.reason = False, _worst(self.energy, newton.x)
        return newton

    def _ways(self) -> Iterator[Newton]:
        """Finished minimisations, the quickest way first.

        Contact displaces the compressible substitute: where steps are bounded it comes after a full
        minimisation, and the rest shape, which may cut through an obstacle, is not tried at all.
        """
        soft = nearly_incompressible(self.energy)
        bounded = any(hasattr(p, "max_step") for p in self.energy.potentials)
        if self.options.barrier and 0.0 < least_volume(self.energy, self.x) < CRUSHED:
            crushed = self._newton(self.x, energy=with_barrier(self.energy, STEEPEST))
            if crushed.record.converged:
                yield crushed
        if inverted(self.energy, self.x) == 0:
            first = self._newton(self.x, impatient=soft and not bounded)
            if not first.struggling:
                yield first
            if soft:
                yield self._by_stand_in(self.x)
                if first.struggling:
                    yield self._newton(self.x)
        else:
            if self.options.untangle:
                yield self._by_stand_in(self.x)
            yield self._newton(self.x)
        if self.options.untangle and not bounded:
            yield self._by_stand_in(from_rest(self.energy, self.x, self.free))

    def _newton(self, x: Array, impatient: bool = False, energy: Sum | None = None) -> Newton:
        energy = energy or self.energy
        newton = Newton(energy, x, self.free, self.options, self.workspace, self.checkpoint, impatient)
        newton.run()
        if newton.struggling:
            self.record.add(newton.record)
        return newton

    def _by_stand_in(self, x: Array) -> Newton:
        loose = by_stand_in(self.energy, x, self.free, self.options, self.workspace)
        self.record.add(loose.record)
        return self._newton(loose.x)


def _worst(energy: Sum, x: Array) -> str:
    """Inverted tets of the body that has the most of them at x (n, 3), and where."""
    bodies = [Validity.check(p.vertices, p.tets, x) for p in energy.potentials if isinstance(p, Elastic)]
    return str(max(bodies, key=lambda body: body.inverted))


def _worth(newton: Newton) -> tuple[bool, int]:
    return newton.record.converged, -newton.record.tangles
