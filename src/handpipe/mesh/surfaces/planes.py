"""Planes of sliding and contact, taken where moved points are closest to moved bodies (Zheng 2022 §6)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.surfaces.distance import Distance

AGREE = 0.5  # least cosine between a surface's normal and the side from which a point touches it
LIFTS = (0.5, 1.0, 2.0, 4.0)  # mm from a point inside a body towards its own side, where the search starts


def touching_planes(
    points: Array, sides: Array, body: IntArray, bodies: Mapping[int, Distance]
) -> tuple[Array, Array]:
    """The plane on which each point touches its own body.

    In a body thinner than twice a point's depth, for instance a tendon, the closest place is on the far side
    and would pull the point through. For such a point the search starts outside, on the point's own side.
    Normals are smooth, as between neighbouring muscles (`tissues.muscles.neighbours.pairs`).

    Parameters
    ----------
    points : array (k, 3)
        Points in mm.
    sides : array (k, 3)
        Unit vectors out of the body on the side where each point belongs.
    body : array (k,) of int
        Index into `bodies` of each point's own body.
    bodies : mapping of int to Distance
        Distances to the surfaces of the bodies, by index.

    Returns
    -------
    places : array (k, 3)
        A place on each plane in mm; the point itself where the search finds none.
    normals : array (k, 3)
        Unit normals of the planes, out of the body; the point's own side where the search finds none.
    """
    places, normals = np.empty_like(points), np.empty_like(points)
    for index, distance in bodies.items():
        mine = body == index
        if mine.any():
            places[mine], normals[mine] = _own_planes(distance, points[mine], sides[mine])
    return places, normals


def astray(signed: Array, normals: Array, sides: Array) -> BoolArray:
    """Which points are inside a body and closest to a side where they do not belong.

    Parameters
    ----------
    signed : array (k,)
        Distances from the points to the surface in mm, negative inside.
    normals : array (k, 3)
        Unit normals at the closest places, out of the body.
    sides : array (k, 3)
        Unit vectors out of the body on the side where each point belongs.

    Returns
    -------
    array (k,) of bool
    """
    return (signed < 0) & (np.einsum("ni,ni->n", normals, sides) < AGREE)


def _own_planes(distance: Distance, points: Array, sides: Array) -> tuple[Array, Array]:
    signed, _, places, normals = distance.smooth(points)
    lost = np.flatnonzero(astray(signed, normals, sides))
    places[lost], normals[lost] = points[lost], sides[lost]
    for lift in LIFTS:
        if len(lost) == 0:
            break
        lifted = points[lost] + lift * sides[lost]
        height, _, place, normal = distance.smooth(lifted)
        found = (height > 0) & (np.einsum("ni,ni->n", normal, sides[lost]) > AGREE)
        places[lost[found]], normals[lost[found]] = place[found], normal[found]
        lost = lost[~found]
    return places, normals
