"""Planes of sliding and contact, taken where moved points are closest to moved bodies (Zheng 2022 §6)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.surfaces.distance import Distance

AGREE = 0.5  # least cosine between a surface's normal and the side from which a point touches it
LIFTS = (0.5, 1.0, 2.0, 4.0)  # mm that a point inside a body is lifted towards its own side to find it again


def touching_planes(
    points: Array, sides: Array, body: IntArray, bodies: Sequence[Distance]
) -> tuple[Array, Array]:
    """A plane's place and normal (k, 3) for each point (k, 3) on the surface of its own body (k,).

    sides (k, 3): unit vectors out of the body on the side where the point belongs. In a body thinner than
    twice a point's depth, a tendon say, the closest place is on the far side and would pull the point
    through: there the place is sought on the point's own side, and a point that finds none is left free.
    Normals are smooth, as between neighbouring muscles (`tissues.muscles.neighbours.pairs`).
    """
    places, normals = np.empty_like(points), np.empty_like(points)
    for index, distance in enumerate(bodies):
        mine = body == index
        if mine.any():
            places[mine], normals[mine] = _own_planes(distance, points[mine], sides[mine])
    return places, normals


def astray(signed: Array, normals: Array, sides: Array) -> BoolArray:
    """Which points (k,) at signed distances (k,) are inside a body and closest to a side that is not theirs.

    normals (k, 3) at the closest places, sides (k, 3): as in `touching_planes`.
    """
    return (signed < 0) & (np.einsum("ni,ni->n", normals, sides) < AGREE)


def _own_planes(distance: Distance, points: Array, sides: Array) -> tuple[Array, Array]:
    signed, _, places, normals = distance.smooth(points)
    lost = np.flatnonzero(astray(signed, normals, sides))
    places[lost], normals[lost] = points[lost], sides[lost]
    for lift in LIFTS:
        lifted = points[lost] + lift * sides[lost]
        height, _, place, normal = distance.smooth(lifted)
        found = (height > 0) & (np.einsum("ni,ni->n", normal, sides[lost]) > AGREE)
        places[lost[found]], normals[lost[found]] = place[found], normal[found]
        lost = lost[~found]
    return places, normals
