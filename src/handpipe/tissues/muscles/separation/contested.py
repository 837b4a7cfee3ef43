"""Attachments inside a neighbour: of muscles that spring from one place, marks reach into one another."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.tissues.muscles.fitting.body import Body
from handpipe.tissues.muscles.separation.parting import Inseparable
from handpipe.tissues.muscles.separation.separation import Separation, separate

Result = TypeVar("Result")
log = logging.getLogger(__name__)

FREE = 0.1  # mm, least distance of an attached vertex from every other muscle
FARTHER = (FREE, 0.5, 1.0)  # mm, tried in turn: triangles at attached vertices reach into the neighbour, too
LEAST = 3  # vertices that stay attached to each bone


def separate_posed(bodies: Mapping[str, Body], bones: Mapping[str, Surface]) -> Separation:
    """Muscles of a pose, separated from one another and from posed bones.

    Where a muscle swells over a neighbour's attachment, that attachment is released: only as far from the
    muscle as the separation needs.

    Parameters
    ----------
    bodies : mapping of str to Body
        Muscles with their surfaces in the pose, in mm.
    bones : mapping of str to Surface
        Posed bones in mm.

    Returns
    -------
    Separation
        Separated surfaces and figures.

    Raises
    ------
    Inseparable
        Where bodies meet however deflated.
    ConvergenceError
        Where volumes find no room, or the last solve has not converged.
    """
    return with_least_margin(lambda margin: _separated(bodies, bones, margin))


def with_least_margin(part: Callable[[float], Result]) -> Result:
    """What `part` returns for the least margin in mm for which it does not raise `Inseparable`."""
    *margins, widest = FARTHER
    for margin in margins:
        try:
            return part(margin)
        except Inseparable as error:
            log.warning("%s Attachments beyond %.1f mm of another muscle are released next", error, margin)
    return part(widest)


def _separated(bodies: Mapping[str, Body], bones: Mapping[str, Surface], margin: float) -> Separation:
    held = {name: body.held for name, body in drop_contested(bodies, 0, margin).items()}
    return separate({name: body.surface for name, body in bodies.items()}, bones, held=held)


def drop_contested(bodies: Mapping[str, Body], least: int = LEAST, margin: float = FREE) -> dict[str, Body]:
    """The same bodies without the attached vertices that are inside or near another body.

    Such attachments make a separation impossible.

    Parameters
    ----------
    bodies : mapping of str to Body
        Bodies by name.
    least : int
        Number of vertices that each bone keeps at least: those that lie farthest out of the other bodies.
    margin : float
        Distance in mm from another body up to which a vertex is released.

    Returns
    -------
    dict of str to Body
        Bodies with fewer attached vertices.
    """
    surfaces = {name: Distance(body.surface) for name, body in bodies.items()}
    found = {}
    for name, body in bodies.items():
        others = [distance for other, distance in surfaces.items() if other != name]
        kept = {
            bone: ids[_kept(_gaps(body.surface.vertices[ids], others), least, margin)]
            for bone, ids in body.attachments.items()
        }
        dropped = len(body.held) - sum(map(len, kept.values()))
        if dropped:
            log.info("%s: %d of %d attached vertices released inside others", name, dropped, len(body.held))
        found[name] = replace(body, attachments=kept)
    return found


def _gaps(points: Array, others: list[Distance]) -> Array:
    """Signed distance (n,) in mm from the nearest of the others."""
    alone = np.full(len(points), np.inf)
    return np.min([alone, *(other.signed(points)[0] for other in others)], axis=0)


def _kept(gaps: Array, least: int, margin: float) -> IntArray:
    order = np.argsort(-gaps, kind="stable")
    count = max(int((gaps > margin).sum()), min(least, len(gaps)))
    return np.sort(order[:count])
