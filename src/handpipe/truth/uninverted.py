"""Equilibria of a body of which nothing is inside out."""

from __future__ import annotations

import logging
from collections.abc import Sequence

from handpipe.errors import ConvergenceError
from handpipe.fem.equilibrium import Equilibrium, Options, solve
from handpipe.fem.potential import Potential
from handpipe.fem.record import Record
from handpipe.truth.body import Body
from handpipe.truth.crushing import Crushing

log = logging.getLogger(__name__)


def uninverted(
    body: Body, energies: Sequence[Potential], found: Equilibrium, options: Options
) -> Equilibrium:
    """An equilibrium of the energies as it is, or, where tissue is inside out, the one beside it that is not.

    There the resistance against crushing goes on to the end, and the body comes to rest anew. Raises
    `ConvergenceError` where tissue stays inside out.
    """
    inverted = body.inverted(found.x)
    if not inverted:
        return found
    log.info("%s: %d tets end inside out, resisting more", options.name, inverted)
    harder = [p.to_the_end() if isinstance(p, Crushing) else p for p in energies]
    again = solve(harder, found.x, fixed=body.fixed, options=options)
    inverted = body.inverted(again.x)
    if inverted:
        raise ConvergenceError(options.name, f"{inverted} tets end inside out: refine, or move less")
    record = Record()
    for part in (found.record, again.record):
        record.add(part)
    return Equilibrium(again.x, record)
