"""Barycentric weights of points in triangles."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, IntArray

FLAT = 1e-24  # of the fourth power of the longest edge: a triangle with a smaller squared area is a line


def barycentric_weights(points: Array, corners: Array) -> Array:
    """Barycentric weights of points in the planes of triangles, one triangle a point.

    Parameters
    ----------
    points : array (k, 3)
        Points in mm. A point off its triangle's plane has the weights of its projection.
    corners : array (k, 3, 3)
        Corners of the triangles in mm, one a row.

    Returns
    -------
    array (k, 3)
        Weights of the corners, which sum to 1; negative beyond an edge. A triangle without area has those of
        the nearest place on its longest edge.
    """
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-300)
    wa = np.einsum("ni,ni->n", np.cross(c - b, points - b), normal) / squared
    wb = np.einsum("ni,ni->n", np.cross(a - c, points - c), normal) / squared
    weights = np.stack([wa, wb, 1 - wa - wb], axis=1)
    lines = np.flatnonzero(flat(corners))
    weights[lines] = _on_longest_edge(points[lines], corners[lines])
    return weights


def flat(corners: Array) -> BoolArray:
    """Which triangles (k,), by their corners (k, 3, 3), have no area to rounding: lines and points."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    longest = np.max([np.einsum("ni,ni->n", e, e) for e in (b - a, c - b, a - c)], axis=0)
    return np.asarray(np.einsum("ni,ni->n", normal, normal) <= FLAT * longest**2)


def _on_longest_edge(points: Array, corners: Array) -> Array:
    """Weights (k, 3) of the places nearest to points (k, 3) on the longest edges of triangles (k, 3, 3)."""
    rows = np.arange(len(points))
    edges = np.roll(corners, -1, axis=1) - corners
    squared = np.einsum("nki,nki->nk", edges, edges)
    first = squared.argmax(axis=1)
    along = np.einsum("ni,ni->n", points - corners[rows, first], edges[rows, first])
    share = np.clip(along / np.maximum(squared[rows, first], 1e-300), 0.0, 1.0)
    weights = np.zeros((len(points), 3))
    weights[rows, first], weights[rows, (first + 1) % 3] = 1.0 - share, share
    return weights


def barycentric_matrix(places: Array, corners: IntArray, vertices: Array) -> sparse.csr_matrix:
    """The matrix that interpolates a surface's vertices to places in its triangles.

    Parameters
    ----------
    places : array (k, 3)
        Places in mm.
    corners : array (k, 3) of int
        Vertices of the triangle in which each place is.
    vertices : array (n, 3)
        Vertices in mm.

    Returns
    -------
    sparse matrix (k, n)
        Barycentric weights; its product with `vertices` gives `places`.
    """
    weights = barycentric_weights(places, vertices[corners])
    starts = 3 * np.arange(len(corners) + 1)
    return sparse.csr_matrix((weights.ravel(), corners.ravel(), starts), shape=(len(corners), len(vertices)))
