"""Barycentric weights of points in triangles."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray


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
        Weights of the corners, which sum to 1; negative beyond an edge.
    """
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-300)
    wa = np.einsum("ni,ni->n", np.cross(c - b, points - b), normal) / squared
    wb = np.einsum("ni,ni->n", np.cross(a - c, points - c), normal) / squared
    return np.stack([wa, wb, 1 - wa - wb], axis=1)


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
