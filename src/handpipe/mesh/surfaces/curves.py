"""Polylines in space: length, resampling, frames, closest points, tubes."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces.surface import Surface

FINER = 20  # points of a spline for each that is kept


def arclength(points: Array) -> Array:
    """Length along a polyline from its first point to each point.

    Parameters
    ----------
    points : array (n, 3)
        Points of the polyline in mm.

    Returns
    -------
    array (n,)
        Lengths in mm, the first one 0.
    """
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def tangents(points: Array) -> Array:
    """Tangents of a polyline: of the segment at the ends, of the bisector between.

    Parameters
    ----------
    points : array (n, 3)
        Points of the polyline in mm, no two neighbours in one place.

    Returns
    -------
    array (n, 3)
        Unit tangents.
    """
    edges = np.diff(points, axis=0)
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    sums = np.concatenate([edges[:1], edges[:-1] + edges[1:], edges[-1:]])
    return sums / np.linalg.norm(sums, axis=1, keepdims=True)


def resample(points: Array, n: int, *, smooth: bool = False) -> Array:
    """Points equally spaced in arc length on a polyline, or on its cubic spline.

    Parameters
    ----------
    points : array (m, 3)
        Points of the polyline in mm.
    n : int
        Number of points wanted.
    smooth : bool
        Whether points lie on the cubic spline through `points`; it takes at least three.

    Returns
    -------
    array (n, 3)
        Points in mm; the first and the last are those of the polyline.
    """
    if smooth and len(points) > 2:
        s = arclength(points)
        fine = CubicSpline(s, points)(np.linspace(0, s[-1], FINER * max(n, len(points))))
        return resample(fine, n)
    s = arclength(points)
    at = np.linspace(0, s[-1], n)
    return np.column_stack([np.interp(at, s, points[:, c]) for c in range(3)])


@njit(cache=True)
def _transport(tangent: Array, first: Array) -> Array:
    normals = np.empty_like(tangent)
    normals[0] = first
    for i in range(1, len(tangent)):
        a, b = tangent[i - 1], tangent[i]
        # The least rotation from a to b, by two reflections.
        middle = a + b
        reflected = normals[i - 1] - 2 * (middle @ normals[i - 1]) / (middle @ middle) * middle
        normals[i] = reflected
        normals[i] -= (b @ normals[i]) * b
        normals[i] /= np.sqrt(normals[i] @ normals[i])
    return normals


def bishop_frames(points: Array, first_normal: Array) -> Array:
    """Frames along a curve that do not twist about it.

    Parameters
    ----------
    points : array (n, 3)
        Points of the curve in mm.
    first_normal : array (3,)
        Normal at the first point, of any length and not parallel to the first tangent; its part along the
        tangent is removed.

    Returns
    -------
    array (n, 3, 3)
        The rows of each frame are the unit tangent, normal and binormal.
    """
    tangent = tangents(points)
    first = np.asarray(first_normal, dtype=np.float64)
    first = first - (first @ tangent[0]) * tangent[0]
    normal = _transport(tangent, first / np.linalg.norm(first))
    return np.stack([tangent, normal, np.cross(tangent, normal)], axis=1)


@njit(cache=True)
def _closest(points, polyline):  # type: ignore[no-untyped-def]
    segment, t = np.zeros(len(points), np.int64), np.zeros(len(points))
    closest, distance = np.zeros_like(points), np.full(len(points), np.inf)
    for i in range(len(points)):
        for s in range(len(polyline) - 1):
            edge = polyline[s + 1] - polyline[s]
            along = (points[i] - polyline[s]) @ edge / max(edge @ edge, 1e-300)
            along = min(max(along, 0.0), 1.0)
            candidate = polyline[s] + along * edge
            gap = np.sqrt((points[i] - candidate) @ (points[i] - candidate))
            if gap < distance[i]:
                segment[i], t[i], closest[i], distance[i] = s, along, candidate, gap
    return segment, t, closest, distance


def closest_on_polyline(points: Array, polyline: Array) -> tuple[IntArray, Array, Array, Array]:
    """The closest place on a polyline to each of several points.

    Parameters
    ----------
    points : array (n, 3)
        Points in mm.
    polyline : array (m, 3)
        Points of the polyline in mm.

    Returns
    -------
    segment : array (n,) of int
        Segment in which the closest place is.
    parameter : array (n,)
        Position in the segment, from 0 at its start to 1 at its end.
    closest : array (n, 3)
        Closest places in mm.
    distance : array (n,)
        Distances to them in mm.
    """
    queries = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    return _closest(queries, np.ascontiguousarray(polyline, dtype=np.float64))


def tube(points: Array, frames: Array, radii: Array, sides: int) -> Surface:
    """A closed tube around a curve, with flat caps at both ends.

    Parameters
    ----------
    points : array (n, 3)
        Points of the curve in mm.
    frames : array (n, 3, 3)
        Frames along the curve, as `bishop_frames` gives them.
    radii : array (n,) or float
        Radii in mm.
    sides : int
        Number of vertices in a ring.

    Returns
    -------
    Surface
        Vertex `sides * i + j` lies on ring i at the angle 2 pi j / sides from the normal towards the
        binormal. The last two vertices are the centres of the caps.
    """
    n = len(points)
    angle = 2 * np.pi * np.arange(sides) / sides
    radius = np.broadcast_to(np.asarray(radii, dtype=np.float64), (n,))
    spokes = (
        np.cos(angle)[None, :, None] * frames[:, None, 1] + np.sin(angle)[None, :, None] * frames[:, None, 2]
    )
    rings = points[:, None] + radius[:, None, None] * spokes
    i, j = np.meshgrid(np.arange(n - 1), np.arange(sides), indexing="ij")
    a, b = (sides * i + j).ravel(), (sides * i + (j + 1) % sides).ravel()
    side = np.concatenate([np.stack([a, b, a + sides], axis=1), np.stack([b, b + sides, a + sides], axis=1)])
    ring, following = np.arange(sides), (np.arange(sides) + 1) % sides
    last = sides * (n - 1)
    start = np.stack([following, ring, np.full(sides, n * sides)], axis=1)
    end = np.stack([last + ring, last + following, np.full(sides, n * sides + 1)], axis=1)
    return Surface(
        np.concatenate([rings.reshape(-1, 3), points[[0, -1]]]), np.concatenate([side, start, end])
    )
