"""Starts with tets inside out: a compressible stand-in turns them back before the real material is asked.

Nearly incompressible bodies have many states at rest that hold knots of inverted tets, since the way out
leads through a change of volume. With a Poisson's ratio of 0.3 there are few.
"""

from __future__ import annotations

import logging
from dataclasses import replace

from numpy.typing import NDArray

from handpipe.fem.elastic import Elastic
from handpipe.fem.newton import Array, Newton, spacing
from handpipe.fem.potential import Sum
from handpipe.fem.record import Equilibrium, Options, Record
from handpipe.fem.system_sequence import SystemSequence

log = logging.getLogger(__name__)

LOOSE = 0.02  # of the spacing of vertices: steps below it end the phase
LOOSE_FORCE = 1e-2


def inverted(energy: Sum, x: Array) -> int:
    """Number of tets of all bodies that are inside out at x (n, 3)."""
    return sum(p.inverted(x) for p in energy.potentials if isinstance(p, Elastic))


def nearly_incompressible(energy: Sum) -> bool:
    """Whether a stand-in would be softer than some body."""
    return any(isinstance(p, Elastic) and p.nearly_incompressible() for p in energy.potentials)


def untangle(energy: Sum, x: Array, free: NDArray, options: Options, systems: SystemSequence) -> Equilibrium:
    """A shape near equilibrium of the compressible stand-in of every body, from x (n, 3)."""
    bodies = [p.compressible() if isinstance(p, Elastic) else p for p in energy.potentials]
    loose = replace(
        options,
        displacement_tolerance=max(options.displacement_tolerance, LOOSE * spacing(x)),
        force_tolerance=max(options.force_tolerance, LOOSE_FORCE),
        name=f"{options.name}, untangling",
    )
    newton = Newton(Sum(bodies), x, free, loose, systems)
    newton.run()
    record = Record(
        untangled=newton.record.iterations,
        factorisations=newton.record.factorisations,
        cg_iterations=newton.record.cg_iterations,
        seconds=newton.record.seconds,
    )
    return Equilibrium(newton.x, record)
