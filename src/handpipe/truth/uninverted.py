"""Equilibria of a body of which nothing is inside out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handpipe.errors import ConvergenceError
from handpipe.fem.equilibrium import Equilibrium, Options, solve
from handpipe.fem.potential import Potential
from handpipe.fem.record import Record
from handpipe.fem.two_level import with_nodes
from handpipe.truth.body import Body
from handpipe.truth.crushing import Crushing

log = logging.getLogger(__name__)


def uninverted(
    body: Body, energies: Sequence[Potential], found: Equilibrium, options: Options
) -> Equilibrium:
    """An equilibrium of the energies as it is, or, where tissue is inside out, the one beside it that is not.

    There the resistance against crushing goes on to the end, and the body comes to rest anew. The points of a
    small quadratic tet do not feel that it folds beside them: the tets between its nodes resist, too.
    Raises `ConvergenceError` where tissue stays inside out.
    """
    folded, tried = np.zeros(len(body.anatomy.mesh.tets), dtype=bool), False
    harder = [p.to_the_end() if isinstance(p, Crushing) else p for p in energies]
    while inverted := body.inverted(found.x):
        more = folded | body.folded(found.x)
        if tried and (more == folded).all():
            raise ConvergenceError(options.name, f"{inverted} tets end inside out: refine, or move less")
        log.info("%s: %d tets end inside out, resisting more", options.name, inverted)
        folded, tried = more, True
        between = [body.between_nodes(folded)] if folded.any() else []
        if options.coarse is not None:
            nodes = np.unique(body.elements.cells[folded])
            options = replace(options, coarse=with_nodes(options.coarse, nodes))
        again = solve([*harder, *between], found.x, fixed=body.fixed, options=options)
        record = Record()
        for part in (found.record, again.record):
            record.add(part)
        found = Equilibrium(again.x, record)
    return found
