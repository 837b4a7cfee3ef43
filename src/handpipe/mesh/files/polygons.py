"""Polygons of a surface file, and the triangles into which they are cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from handpipe.core import Array, BoolArray, IntArray

FLAT = 1e-9  # of a polygon's size squared: a corner that turns less is straight


@dataclass(frozen=True)
class Polygons:
    """Polygons over the vertices of a file.

    Parameters
    ----------
    corners : array (c,) of int
        Vertices of all corners, polygon after polygon.
    counts : array (f,) of int
        Number of corners of each polygon.
    """

    corners: IntArray
    counts: IntArray

    @property
    def starts(self) -> IntArray:
        """The first corner (f,) of each polygon."""
        return np.cumsum(self.counts) - self.counts


class NotSimple(ValueError):
    """A polygon that crosses itself; `number` is its place among the polygons."""

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__(f"polygon {number} crosses itself")


def triangulate(vertices: Array, polygons: Polygons) -> IntArray:
    """Triangles of polygons, in the polygons' order and with their orientation.

    A convex polygon becomes a fan about its first corner. Any other is cut by its ears (Meisters 1975), seen
    along its mean normal. A polygon of one or two corners has no area and becomes no triangle.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions of the vertices.
    polygons : Polygons
        Polygons over them.

    Returns
    -------
    array (k, 3) of int
        Vertices of each triangle.

    Raises
    ------
    NotSimple
        For a polygon that crosses itself.
    """
    triangles = np.zeros((0, 3), dtype=np.int64)
    owners = np.zeros(0, dtype=np.int64)
    for count in np.unique(polygons.counts[polygons.counts >= 3]):
        which = np.flatnonzero(polygons.counts == count)
        corners = polygons.corners[polygons.starts[which][:, None] + np.arange(count)]
        found = _cut(vertices, corners, which)
        triangles = np.concatenate([triangles, found.reshape(-1, 3)])
        owners = np.concatenate([owners, np.repeat(which, count - 2)])
    return triangles[np.argsort(owners, kind="stable")]


def _cut(vertices: Array, corners: IntArray, numbers: IntArray) -> IntArray:
    """Triangles (f, count - 2, 3) of polygons (f, count) that have these numbers (f,) in the file."""
    count = corners.shape[1]
    fan = np.stack(
        [np.zeros(count - 2, dtype=np.int64), np.arange(1, count - 1), np.arange(2, count)], axis=1
    )
    cuts = np.broadcast_to(fan, (len(corners), count - 2, 3)).copy()
    if count > 3:
        points = vertices[corners]
        normals = _newell(points)
        for i in np.flatnonzero(~_convex(points, normals)):
            ears = _ears(_flattened(points[i], normals[i]))
            if len(ears) == 0:
                raise NotSimple(int(numbers[i]))
            cuts[i] = ears
    return np.take_along_axis(corners, cuts.reshape(len(corners), -1), axis=1).reshape(-1, count - 2, 3)


def _newell(points: Array) -> Array:
    """Area vectors (f, 3) of closed polygons (f, count, 3)."""
    centred = points - points.mean(axis=1, keepdims=True)
    return np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)


def _convex(points: Array, normals: Array) -> BoolArray:
    """Which polygons (f,) turn the same way at every corner, and once around in all."""
    edges = np.roll(points, -1, axis=1) - points
    before = np.roll(edges, 1, axis=1)
    turns = np.einsum("fci,fi->fc", np.cross(before, edges), normals)
    size = np.einsum("fi,fi->f", normals, normals)
    along = np.einsum("fci,fci->fc", before, edges) * np.sqrt(size)[:, None]
    around = np.arctan2(turns, along).sum(axis=1)
    return (turns >= -FLAT * size[:, None]).all(axis=1) & (around < 3 * np.pi)


def _flattened(points: Array, normal: Array) -> Array:
    """A polygon (count, 3) as seen against its normal, (count, 2): counter-clockwise."""
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    u = np.cross(axis, normal)
    v = np.cross(normal, u)
    return (points - points.mean(axis=0)) @ np.stack([u / np.linalg.norm(u), v / np.linalg.norm(v)], axis=1)


@njit(cache=True)
def _ears(points):  # type: ignore[no-untyped-def]
    """Triangles (count - 2, 3) of a counter-clockwise polygon (count, 2); none where it crosses itself."""
    count = len(points)
    left = np.arange(count)
    found = np.empty((count - 2, 3), np.int64)
    for k in range(count - 2):
        remaining = count - k
        best, widest = -1, 0.0
        for i in range(remaining):
            a, b, c = left[i - 1], left[i], left[(i + 1) % remaining]
            area = _area(points[a], points[b], points[c])
            if area < 0:
                continue
            free = True
            for j in range(remaining):
                p = left[j]
                if p != a and p != b and p != c and _holds(points[a], points[b], points[c], points[p]):
                    free = False
                    break
            lengths = _squared(points[a], points[b]) + _squared(points[b], points[c])
            shape = area / (lengths + _squared(points[c], points[a]) + 1e-300)
            if free and (best < 0 or shape > widest):
                best, widest = i, shape
        if best < 0:
            return found[:0]
        found[k] = left[best - 1], left[best], left[(best + 1) % remaining]
        left = np.concatenate((left[:best], left[best + 1 :]))
    return found


@njit(cache=True)
def _area(a, b, c):  # type: ignore[no-untyped-def]
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


@njit(cache=True)
def _squared(a, b):  # type: ignore[no-untyped-def]
    return (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2


@njit(cache=True)
def _holds(a, b, c, p):  # type: ignore[no-untyped-def]
    """Whether point p is in the counter-clockwise triangle a, b, c or on its border, but at no corner."""
    for corner in (a, b, c):
        if _squared(corner, p) == 0.0:
            return False
    return _area(a, b, p) >= 0 and _area(b, c, p) >= 0 and _area(c, a, p) >= 0
