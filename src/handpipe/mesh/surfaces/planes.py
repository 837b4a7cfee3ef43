"""Planes of sliding and contact, taken where moved points are closest to moved bodies (Zheng 2022 §6)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.surfaces.distance import Distance

AGREE = 0.5  # least cosine between a surface's normal and the side from which a point touches it
FAR = 4.0  # mm to its own side, at most, that a point may be inside a body: from farther it is left free


def touching_planes(
    points: Array, sides: Array, body: IntArray, bodies: Mapping[int, Distance]
) -> tuple[Array, Array]:
    """The plane on which each point touches its own body.

    In a body thinner than twice a point's depth, for instance a tendon, the closest place is on the far side
    and would pull the point through. Such a point has the plane where the way to its own side leaves the
    body; between both, a mean of both planes: a plane that jumps as a point moves pushes it to and fro
    without end. Normals are smooth, as between neighbouring muscles (`tissues.muscles.neighbours.pairs`).

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
        A place on each plane in mm; the point itself where no way leads out.
    normals : array (k, 3)
        Unit normals of the planes, out of the body; the point's own side where no way leads out.
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


@dataclass(frozen=True)
class WaysBack:
    """Where points that are astray in a body leave it on their own side.

    Parameters
    ----------
    points : array (c,) of int
        Which points they are.
    share : array (c,)
        Share of the closest place in the mean with the place where a point leaves: no plane jumps as a point
        goes astray.
    triangles : array (c,) of int
        Triangles in which they leave; -1 where no way of 4 mm leads out.
    places : array (c, 3)
        Where they leave, in mm; the point itself where no way leads out.
    normals : array (c, 3)
        Mean unit normals of both places; the own side counts as normal where no way leads out.
    """

    points: IntArray
    share: Array
    triangles: IntArray
    places: Array
    normals: Array

    @staticmethod
    def of(distance: Distance, points: Array, signed: Array, normals: Array, sides: Array) -> WaysBack:
        """Ways back of points (k, 3) in mm, with the distances, normals and sides of `astray`."""
        ids = np.flatnonzero(astray(signed, normals, sides))
        _, triangles, places, there = distance.ways_out(points[ids], sides[ids], FAR)
        share = np.clip(np.einsum("ni,ni->n", normals[ids], sides[ids]) / AGREE, 0.0, 1.0)
        mixed = share[:, None] * normals[ids] + (1 - share)[:, None] * there
        mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
        return WaysBack(ids, share, triangles, places, mixed)


def _own_planes(distance: Distance, points: Array, sides: Array) -> tuple[Array, Array]:
    signed, _, places, normals = distance.smooth(points)
    back = WaysBack.of(distance, points, signed, normals, sides)
    share = back.share[:, None]
    places[back.points] = share * places[back.points] + (1 - share) * back.places
    normals[back.points] = back.normals
    return places, normals
