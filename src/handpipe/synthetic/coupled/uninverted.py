"""Equilibria of a body of which nothing is inside out."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handpipe.core import Array, BoolArray, ConvergenceError
from handpipe.fem.linear import with_nodes
from handpipe.fem.minimisation import Record
from handpipe.fem.potentials import Expansion, Potential, Sum
from handpipe.fem.solver import Equilibrium, Options, solve
from handpipe.synthetic.continuum.crushing import CRUSHED, LAST, STEEPEST, Crushing
from handpipe.synthetic.continuum.density import DensityPotential
from handpipe.synthetic.coupled.body import Body
from handpipe.synthetic.coupled.element_repair import repair_elements

log = logging.getLogger(__name__)

NEARLY = 0.1  # of its volume at rest: a tet between nodes that has less left folds where its neighbours turn
FURTHER, LEAST = 0.1, 1e-5  # how much further what stays inside out resists, each time, and at most
RINGS = 2  # of elements about those inside out, which turn before all else moves


def uninverted(
    body: Body,
    energies: Sequence[Potential],
    found: Equilibrium,
    options: Options,
    right: Array | None = None,
) -> Equilibrium:
    """An equilibrium of the energies as it is, or, where tissue is inside out, the one beside it that is not.

    There the resistance against crushing goes on to the end, and the body comes to rest anew. The points of a
    small quadratic tet do not feel that it folds beside them: the tets between its nodes resist, too. What is
    pressed from both sides may stay inside out by a hair, and resists further then.
    What turns takes many short steps, so that it turns first, with its surroundings alone; not at all where
    positions `right` (n, 3) near the equilibrium are known of which nothing is inside out: there it begins.
    Raises `ConvergenceError` where tissue stays inside out.
    """
    folded, tried, last = np.zeros(len(body.anatomy.mesh.tets), dtype=bool), False, LAST
    while inverted := body.inverted(found.x):
        more = folded | body.folded(found.x, NEARLY)
        if tried and (more == folded).all():
            last *= FURTHER
        if last < LEAST:
            problem = f"{inverted} tets end inside out, {_place(body, found.x)}: refine, or move less"
            raise ConvergenceError(options.name, problem)
        log.info("%s: %d tets end inside out, resisting more", options.name, inverted)
        known = None if tried or right is None else repair_elements(body, found.x, right)
        folded, tried = more if known is None else more | body.folded(known[0], NEARLY), True
        harder = [p.to_the_end(last) if isinstance(p, Crushing) else p for p in energies]
        between = [body.between_nodes(folded, last)] if folded.any() else []
        if options.coarse is not None:
            nodes = np.unique(body.elements.cells[folded])
            options = replace(options, coarse=with_nodes(options.coarse, nodes))
        resisting = [*harder, *between]
        wrong = folded | body.crushed(found.x, STEEPEST * CRUSHED)  # beyond which the resistance is another
        start = found.x if known is None else known[0]
        moving = _about(body, wrong) if known is None else known[1]
        start = _turned(body, resisting, moving, start, options)
        if known is None and Sum(resisting).value(start) > Sum(resisting).value(found.x):
            start = found.x
        again = solve(resisting, start, fixed=body.fixed, options=options)
        record = Record()
        for part in (found.record, again.record):
            record.add(part)
        found = Equilibrium(again.x, record)
    return found


def _turned(
    body: Body, energies: Sequence[Potential], moving: BoolArray, x: Array, options: Options
) -> Array:
    """Positions (n, 3) at which the nodes of a mask (n,) rest, while all others stay.

    What is no tissue, contact above all, acts as for small moves from x.
    """
    nodes = body.elements.nodes_of(body.elements.touching(moving))
    tissue: list[Potential] = [p.about(moving, nodes) for p in energies if isinstance(p, DensityPotential)]
    others = [p for p in energies if not isinstance(p, DensityPotential)]
    fixed = body.fixed | np.repeat(~moving, 3)
    options = replace(options, name=f"{options.name}, in places", coarse=None, allow_partial=True)
    local = [*tissue, Expansion(others, x, nodes)] if others else tissue
    out = x.copy()
    out[nodes] = solve(local, x[nodes], fixed=fixed[np.repeat(nodes, 3)], options=options).x
    return out


def _place(body: Body, x: Array) -> str:
    """Where the first element is that is inside out at x (n, 3), and in what."""
    cell = int(np.flatnonzero(body.inside_out(x))[0])
    at = ", ".join(f"{c:.1f}" for c in x[body.elements.cells[cell]].mean(axis=0))
    return f"first at ({at}) in {body.anatomy.regions[body.anatomy.labels[cell]]}"


def _about(body: Body, cells: BoolArray) -> BoolArray:
    """The nodes (n,) of some cells (m,) and of those around them."""
    for _ in range(RINGS):
        cells = body.elements.touching(body.elements.nodes_of(cells))
    return body.elements.nodes_of(cells)
