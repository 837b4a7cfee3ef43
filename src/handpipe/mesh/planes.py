"""Planes of sliding and contact, taken where moved points are closest to moved bodies (000 section 6)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handpipe.mesh.distance import Distance
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]

AGREE = 0.5  # least cosine between a surface's normal and the side from which a point touches it
LIFTS = (0.5, 1.0, 2.0, 4.0)  # mm that a point inside a body is lifted towards its own side to find it again


def touching_planes(
    points: Array, sides: Array, body: IntArray, surfaces: Sequence[Surface]
) -> tuple[Array, Array]:
    """A plane's place and normal (k, 3) for each point (k, 3) on the surface of its own body (k,).

    sides (k, 3): unit vectors out of the body on the side where the point belongs. In a body thinner than
    twice a point's depth, a tendon say, the closest place is on the far side and would pull the point
    through: there the place is sought on the point's own side, and a point that finds none is left free.
    """
    places, normals = np.empty_like(points), np.empty_like(points)
    for index, surface in enumerate(surfaces):
        mine = body == index
        if mine.any():
            places[mine], normals[mine] = _on_own_side(Distance(surface), points[mine], sides[mine])
    return places, normals


def _on_own_side(distance: Distance, points: Array, sides: Array) -> tuple[Array, Array]:
    signed, _, places, normals = distance.signed(points)
    astray = np.flatnonzero((signed < 0) & (np.einsum("ni,ni->n", normals, sides) < AGREE))
    places[astray], normals[astray] = points[astray], sides[astray]
    for lift in LIFTS:
        lifted = points[astray] + lift * sides[astray]
        height, _, place, normal = distance.signed(lifted)
        found = (height > 0) & (np.einsum("ni,ni->n", normal, sides[astray]) > AGREE)
        places[astray[found]], normals[astray[found]] = place[found], normal[found]
        astray = astray[~found]
    return places, normals
