"""How the distance to a polyhedral surface curves where an edge or a vertex is closest."""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import EDGE, FACE, nearest_feature


@njit(cache=True)
def shape_operators(
    normals: Array, closest: Array, triangles: IntArray, vertices: Array, corners: IntArray
) -> Array:
    """Second derivatives (k, 3, 3) of the distance times the distance: projections along which it curves.

    normals (k, 3) towards the points from their closest points (k, 3) on triangles (k,) of the surface
    (vertices, corners). Zero over a face, I - n n^T - t t^T over an edge along t, I - n n^T over a vertex:
    exact within each of these cells, between which the second derivative jumps.
    """
    out = np.zeros((len(closest), 3, 3))
    for i in range(len(closest)):
        feature, at = nearest_feature(closest, i, vertices, corners, triangles[i])
        if feature == FACE:
            continue
        for j in range(3):
            for k in range(3):
                out[i, j, k] = (1.0 if j == k else 0.0) - normals[i, j] * normals[i, k]
        if feature == EDGE:
            a, b = corners[triangles[i], (at + 1) % 3], corners[triangles[i], (at + 2) % 3]
            squared = 0.0
            for k in range(3):
                squared += (vertices[b, k] - vertices[a, k]) ** 2
            for j in range(3):
                for k in range(3):
                    along = (vertices[b, j] - vertices[a, j]) * (vertices[b, k] - vertices[a, k])
                    out[i, j, k] -= along / squared
    return out
