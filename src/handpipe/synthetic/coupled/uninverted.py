"""Equilibria of a coupled body without inverted elements."""

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
from handpipe.synthetic.continuum.crushing import CRUSHED, LAST, STEEPEST, QuadratureCrushing
from handpipe.synthetic.continuum.density import DensityPotential
from handpipe.synthetic.coupled.coupled_body import CoupledBody
from handpipe.synthetic.coupled.element_repair import repair_elements

log = logging.getLogger(__name__)

NEARLY = 0.1  # of its volume at rest: a tet between nodes with less inverts when its neighbours turn over
FURTHER, LEAST = 0.1, 1e-5  # of `last` where elements stay inverted, and its least value
RINGS = 2  # of elements around inverted ones, which move before all others


def uninverted(
    body: CoupledBody,
    energies: Sequence[Potential],
    found: Equilibrium,
    options: Options,
    right: Array | None = None,
) -> Equilibrium:
    """An equilibrium of the energies as found, or a nearby one without inverted tissue.

    Where tissue is inverted, the resistance to crushing becomes logarithmic down to smaller volumes, and the
    equilibrium is solved again. The quadrature points of a small quadratic tet may miss an inversion beside
    them: the tets between its nodes resist, too. Tissue that is pressed from both sides may stay slightly
    inverted; then the resistance continues further. Inverted elements take many short steps to turn over, so
    they move first, with their surroundings alone. If uninverted positions `right` (n, 3) near the
    equilibrium are known, the solve starts from these instead.

    Raises
    ------
    ConvergenceError
        If tissue stays inverted.
    """
    folded, tried, last = np.zeros(len(body.anatomy.mesh.tets), dtype=bool), False, LAST
    while inverted := body.inverted(found.x):
        more = folded | body.folded(found.x, NEARLY)
        if tried and (more == folded).all():
            last *= FURTHER
        if last < LEAST:
            problem = f"{inverted} tets end inside out, {_place(body, found.x)}: refine, or move less"
            raise ConvergenceError(options.name, problem)
        log.info("%s: %d inverted tets; retrying with more resistance to crushing", options.name, inverted)
        known = None if tried or right is None else repair_elements(body, found.x, right)
        folded, tried = more if known is None else more | body.folded(known[0], NEARLY), True
        harder = [p.to_the_end(last) if isinstance(p, QuadratureCrushing) else p for p in energies]
        between = [body.between_nodes(folded, last)] if folded.any() else []
        if options.coarse is not None:
            nodes = np.unique(body.elements.cells[folded])
            options = replace(options, coarse=with_nodes(options.coarse, nodes))
        resisting = [*harder, *between]
        wrong = folded | body.crushed(found.x, STEEPEST * CRUSHED)  # where the resistance differs from before
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
    body: CoupledBody, energies: Sequence[Potential], moving: BoolArray, x: Array, options: Options
) -> Array:
    """Positions (n, 3) in equilibrium at the nodes of a mask (n,), while all other nodes stay.

    Potentials other than tissue's, mainly contact, are expanded to second order at x.
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


def _place(body: CoupledBody, x: Array) -> str:
    """Place and region of the first inverted element at x (n, 3)."""
    cell = int(np.flatnonzero(body.inside_out(x))[0])
    at = ", ".join(f"{c:.1f}" for c in x[body.elements.cells[cell]].mean(axis=0))
    return f"first at ({at}) in {body.anatomy.regions[body.anatomy.labels[cell]]}"


def _about(body: CoupledBody, cells: BoolArray) -> BoolArray:
    """The nodes (n,) of some cells (m,) and of those around them."""
    for _ in range(RINGS):
        cells = body.elements.touching(body.elements.nodes_of(cells))
    return body.elements.nodes_of(cells)
