"""Repair of inverted elements: a valid shape, deformed to match, replaces the nodes around them."""

from __future__ import annotations

import logging

import numpy as np

from handpipe.core import Array, BoolArray
from handpipe.fem.linear import factorise
from handpipe.mesh.tets import dirichlet_matrix, shape_gradients
from handpipe.synthetic.coupled.coupled_body import CoupledBody

log = logging.getLogger(__name__)

RINGS = (2, 3, 4, 6)  # of replaced elements around inverted ones: the fewest that suffice
SPREADING = 4  # times that elements inverted by a repair are replaced, too


def repair_elements(body: CoupledBody, x: Array, right: Array) -> tuple[Array, BoolArray] | None:
    """Positions (n, 3) without inverted elements or skin through skin, and the mask (n,) of replaced nodes.

    They are the positions x except at the replaced nodes. There they are `right` (n, 3), positions of the
    same body without inverted elements, plus the difference of x from it around these nodes, continued
    harmonically: so smooth a field bends `right` little. None where no such positions are found.
    """
    first, away = body.inside_out(x), x - right
    for rings in RINGS:
        wrong = first
        for _ in range(SPREADING):
            taken = _within(body, wrong, rings)
            found = x.copy()
            found[taken] = right[taken] + _harmonic(body, away, taken)
            now = body.inside_out(found)
            if not now.any() and (body.barrier is None or not body.barrier.intersects(found)):
                log.info("%d nodes replaced by those of an uninverted shape", taken.sum())
                return found, taken
            if not (now & ~wrong).any():
                break
            wrong = wrong | now
    return None


def _within(body: CoupledBody, cells: BoolArray, rings: int) -> BoolArray:
    """The nodes (n,) in some cells (m,) and the rings about them, without those on the border or on bones."""
    for _ in range(rings):
        cells = body.elements.touching(body.elements.nodes_of(cells))
    return body.elements.nodes_of(cells) & ~body.elements.nodes_of(~cells) & ~body.fixed[::3]


def _harmonic(body: CoupledBody, values: Array, inside: BoolArray) -> Array:
    """Harmonic continuation (k, 3) into the nodes of a mask (n,) of values (n, 3) at the others."""
    near = inside[body.cells.tets].any(axis=1)
    tets, volumes = body.cells.tets[near], body.cells.volumes()[near]
    laplacian = dirichlet_matrix(tets, shape_gradients(body.rest, tets), volumes, len(values))
    known = laplacian[inside][:, ~inside] @ values[~inside]
    return np.asarray(factorise(laplacian[inside][:, inside]).solve(-known))
