"""Skin that does not penetrate itself: pushed apart where it does, then at rest behind a barrier."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from handpipe.core import Array, ConvergenceError, IntArray
from handpipe.fem.contact import Barrier
from handpipe.fem.minimisation import Equilibrium
from handpipe.fem.solver import NearEnough, Settled, settle
from handpipe.mesh.contact import crossings, self_contact
from handpipe.tissues.fat.resting.load_case import CONTACTS, OPTIONS, LoadCase
from handpipe.tissues.fat.resting.skin_pushes import crossing_vertices, pushes
from handpipe.tissues.fat.skin_contact import DEEP, DISTANCE
from handpipe.tissues.fat.tissue import Tissue

log = logging.getLogger(__name__)

MARGIN, GROWTH = 0.2, 0.05  # mm beyond other skin to which skin is pushed; its growth where that did not do
ROUNDS = 12  # of pushes, at most
EARLY, FALLEN = 4, 0.25  # after so many rounds, the share of crossing vertices from which they end
REMEDY = "The pose may leave no room for flesh: bend less, or scan a pose near it."


def kept_apart(case: LoadCase, settled: Settled) -> Settled:
    """The equilibrium behind a barrier of the skin against itself, near one with contact planes.

    Parameters
    ----------
    case : LoadCase
        The tissue in a frame.
    settled : Settled
        Its equilibrium with contact planes.

    Returns
    -------
    Settled
        The equilibrium. Where no parts of the skin are within 0.1 mm of one another, or the neutral skin
        intersects itself, it is `settled` itself.

    Raises
    ------
    ConvergenceError
        Where the skin cannot be pushed apart, or has no equilibrium behind the barrier.
    """
    barrier, x = case.tissue.skin_barrier(), settled.x
    if barrier is None:
        return settled
    if len(crossings(case.skin(x))):
        x = _pushed_apart(case, x)
    elif not np.isfinite(barrier.gap(x)):
        return settled
    found = behind(case, barrier, x)
    return replace(found, renewals=settled.renewals + found.renewals)


def behind(case: LoadCase, barrier: Barrier, start: Array) -> Settled:
    """The equilibrium with a barrier, from a start without crossings; the bodies' planes are renewed.

    Each solve starts from the one before: what the renewal makes of two of them may intersect.

    Parameters
    ----------
    case : LoadCase
        The tissue in a frame.
    barrier : Barrier
        The barrier of its skin.
    start : array (n, 3)
        Vertices in mm.

    Returns
    -------
    Settled
        The equilibrium.

    Raises
    ------
    ConvergenceError
        Where there is no equilibrium, or an independent count finds crossings.
    """
    free = [start]

    def in_place(planes: Array, enough: NearEnough | None) -> Equilibrium:
        found = case.equilibrium([barrier], planes, free[-1], replace(OPTIONS, enough=enough))
        free.append(found.x)
        return found

    settled = settle(in_place, start, CONTACTS, "soft tissue, skin behind a barrier", case.skin_motion)
    left = crossing_vertices(case.skin(settled.x))
    if len(left):
        raise _no_room(case, settled.x, left)
    return settled


def _pushed_apart(case: LoadCase, x: Array) -> Array:
    """Positions near x (n, 3) at which the skin does not cross itself."""
    tissue = case.tissue
    stiffness = tissue.settings.stiffness * tissue.skin_areas
    margins, counts = np.full(len(tissue.skin.vertices), MARGIN), list[int]()
    while True:
        skin = case.skin(x)
        left = crossing_vertices(skin)
        counts.append(len(left))
        log.info("soft tissue: %d skin vertices at crossings after %d pushes", len(left), len(counts) - 1)
        if not len(left):
            return x
        if len(counts) > ROUNDS or (len(counts) > EARLY and counts[-1] > FALLEN * counts[0]):
            raise _no_room(case, x, left)
        contact = pushes(tissue.skin, skin, tissue.skin_matrix, stiffness, margins)
        try:
            x = case.equilibrium(contact, x, x).x
        except ConvergenceError as error:  # as where pushes against one another turn tets inside out
            raise _no_room(case, x, left) from error
        margins[left] += GROWTH


def _no_room(case: LoadCase, x: Array, vertices: IntArray) -> ConvergenceError:
    """The skin crosses itself at vertices (k,) with the tissue at x (n, 3)."""
    tissue, skin = case.tissue, case.skin(x)
    bones = (tissue.skin_matrix[vertices] @ tissue.weights).sum(axis=0)
    near = [tissue.bones[i] for i in np.argsort(-bones)[:2] if bones[i] > 0]
    place = ", ".join(f"{c:.1f}" for c in np.median(skin.vertices[vertices], axis=0))
    reason = f"{len(vertices)} skin vertices at crossings of the skin with itself, around ({place}) mm"
    return ConvergenceError("skin on skin", f"{reason}, near {' and '.join(near)}", REMEDY)


def penetration(tissue: Tissue, x: Array) -> dict[str, float]:
    """How a skin touches itself.

    Parameters
    ----------
    tissue : Tissue
        The tissue.
    x : array (n, 3)
        Its vertices in mm.

    Returns
    -------
    dict of str to float
        `skin_inside`: vertices inside other skin; `skin_crossings`: edges through triangles; `skin_gap`:
        least distance in mm of two parts, 0.1 at most, zero where they cross.
    """
    skin = tissue.skin.moved(tissue.skin_matrix @ x)
    count = len(crossings(skin))
    inside = len(self_contact(skin, tissue.skin, 0.0, DEEP).vertices) if count else 0
    barrier = tissue.skin_barrier()
    gap = 0.0 if count or barrier is None else min(DISTANCE, barrier.gap(x))
    return {"skin_inside": float(inside), "skin_crossings": float(count), "skin_gap": gap}
