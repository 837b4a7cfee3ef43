"""Equilibria of a body of which nothing is inside out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handpipe.errors import ConvergenceError
from handpipe.fem.equilibrium import Equilibrium, Options, solve
from handpipe.fem.expansion import Expansion
from handpipe.fem.potential import Potential, Sum
from handpipe.fem.record import Record
from handpipe.fem.two_level import with_nodes
from handpipe.truth.body import Body
from handpipe.truth.crushing import Crushing

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
log = logging.getLogger(__name__)

RINGS = 2  # of elements about those inside out, which turn before all else moves


def uninverted(
    body: Body, energies: Sequence[Potential], found: Equilibrium, options: Options
) -> Equilibrium:
    """An equilibrium of the energies as it is, or, where tissue is inside out, the one beside it that is not.

    There the resistance against crushing goes on to the end, and the body comes to rest anew. The points of a
    small quadratic tet do not feel that it folds beside them: the tets between its nodes resist, too.
    What turns takes many short steps, so that it turns first, with its surroundings alone.
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
        resisting = [*harder, *between]
        start = _turned(body, energies, folded | body.crushed(found.x), found.x, options)
        if Sum(resisting).value(start) > Sum(resisting).value(found.x):
            start = found.x
        again = solve(resisting, start, fixed=body.fixed, options=options)
        record = Record()
        for part in (found.record, again.record):
            record.add(part)
        found = Equilibrium(again.x, record)
    return found


def _turned(body: Body, energies: Sequence[Potential], wrong: Mask, x: Array, options: Options) -> Array:
    """Positions (n, 3), near x, at which some elements (m,) resist and all but their surroundings stays:
    these with their energies for small moves.
    """
    near = _about(body, wrong)
    local: list[Potential] = [Expansion(energies, x, near), body.between_nodes(wrong, near)]
    options = replace(options, name=f"{options.name}, in places", coarse=None, allow_partial=True)
    out = x.copy()
    out[near] = solve(local, x[near], fixed=body.fixed[np.repeat(near, 3)], options=options).x
    return out


def _about(body: Body, cells: Mask) -> Mask:
    """The nodes (n,) of some cells (m,) and of those around them."""
    nodes = np.zeros(len(body.rest), dtype=bool)
    for _ in range(1 + RINGS):
        nodes[body.elements.cells[cells]] = True
        cells = np.asarray(nodes[body.elements.cells].any(axis=1))
    return nodes
