"""Barycentric weights of points in triangles."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray


def barycentric_weights(points: Array, corners: Array) -> Array:
    """Weights (k, 3) of points (k, 3) in the planes of triangles (k, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ni,ni->n", normal, normal), 1e-300)
    wa = np.einsum("ni,ni->n", np.cross(c - b, points - b), normal) / squared
    wb = np.einsum("ni,ni->n", np.cross(a - c, points - c), normal) / squared
    return np.stack([wa, wb, 1 - wa - wb], axis=1)


def barycentric_matrix(places: Array, corners: IntArray, vertices: Array) -> sparse.csr_matrix:
    """Matrix (k, n) by which vertices (n, 3) make up places (k, 3) in triangles of corners (k, 3)."""
    weights = barycentric_weights(places, vertices[corners])
    starts = 3 * np.arange(len(corners) + 1)
    return sparse.csr_matrix((weights.ravel(), corners.ravel(), starts), shape=(len(corners), len(vertices)))
