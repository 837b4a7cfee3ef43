"""Attachments inside a neighbour.

Muscles that originate at one place have attachments that reach into one another.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import TypeVar

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.mesh.contact import distance_to
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.tissues.muscles.fitting.soft_body import SoftBody
from handpipe.tissues.muscles.separation.disjoint_start import Inseparable
from handpipe.tissues.muscles.separation.separation import Separation, separate

Result = TypeVar("Result")
log = logging.getLogger(__name__)

CLEAR = 0.1  # mm, least distance of an attached vertex from other muscles
MARGINS = (CLEAR, 0.5, 1.0)  # mm, in order: triangles at attached vertices can reach into the neighbour, too
LEAST_ATTACHED = 3  # vertices that stay attached to each bone, at least


def separate_posed(bodies: Mapping[str, SoftBody], bones: Mapping[str, Surface]) -> Separation:
    """Muscles of a pose, separated from one another and from posed bones.

    An attachment that a neighbour covers is released, within the least margin that lets the separation
    succeed.

    Parameters
    ----------
    bodies : mapping of str to SoftBody
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
    for margin, wider in pairwise(MARGINS):
        try:
            return part(margin)
        except Inseparable as error:
            log.warning("%s Retrying: releasing attachments within %.1f mm of other muscles", error, wider)
    return part(MARGINS[-1])


def _separated(bodies: Mapping[str, SoftBody], bones: Mapping[str, Surface], margin: float) -> Separation:
    attached = {name: body.attached_vertices for name, body in drop_contested(bodies, 0, margin).items()}
    return separate({name: body.surface for name, body in bodies.items()}, bones, attached=attached)


def drop_contested(
    bodies: Mapping[str, SoftBody], least: int = LEAST_ATTACHED, margin: float = CLEAR
) -> dict[str, SoftBody]:
    """The same bodies without the attached vertices that are inside or near another body.

    With such attachments no separation exists.

    Parameters
    ----------
    bodies : mapping of str to SoftBody
        Bodies by name.
    least : int
        Number of vertices that each bone keeps at least: the vertices farthest outside the other bodies.
    margin : float
        Distance in mm from another body up to which a vertex is released.

    Returns
    -------
    dict of str to SoftBody
        Bodies with fewer attached vertices.
    """
    surfaces = {name: distance_to(body.surface) for name, body in bodies.items()}
    found = {}
    for name, body in bodies.items():
        others = [distance for other, distance in surfaces.items() if other != name]
        kept = {
            bone: ids[_kept(_gaps(body.surface.vertices[ids], others), least, margin)]
            for bone, ids in body.attachments.items()
        }
        dropped = len(body.attached_vertices) - sum(map(len, kept.values()))
        if dropped:
            log.info(
                "%s: released %d of %d attached vertices, which are inside or near other muscles",
                name,
                dropped,
                len(body.attached_vertices),
            )
        found[name] = replace(body, attachments=kept)
    return found


def _gaps(points: Array, others: list[Distance]) -> Array:
    """Signed distance (n,) in mm from the nearest other body."""
    alone = np.full(len(points), np.inf)
    return np.min([alone, *(other.signed(points)[0] for other in others)], axis=0)


def _kept(gaps: Array, least: int, margin: float) -> IntArray:
    order = np.argsort(-gaps, kind="stable")
    count = max(int((gaps > margin).sum()), min(least, len(gaps)))
    return np.sort(order[:count])
