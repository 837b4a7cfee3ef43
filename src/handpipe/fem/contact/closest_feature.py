"""How the distance to a polyhedral surface curves where an edge or a vertex is closest."""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import ON_EDGE


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
        a, b, c = (
            vertices[corners[triangles[i], 0]],
            vertices[corners[triangles[i], 1]],
            vertices[corners[triangles[i], 2]],
        )
        normal = np.cross(b - a, c - a)
        squared = max(normal @ normal, 1e-300)
        weight = np.empty(3)
        weight[0] = np.cross(c - b, closest[i] - b) @ normal / squared
        weight[1] = np.cross(a - c, closest[i] - c) @ normal / squared
        weight[2] = 1.0 - weight[0] - weight[1]
        if weight.min() >= ON_EDGE:
            continue
        n = normals[i]
        out[i] = np.eye(3) - np.outer(n, n)
        if weight.max() <= 1.0 - ON_EDGE:
            off = np.argmin(weight)
            t = c - b if off == 0 else (a - c if off == 1 else b - a)
            out[i] -= np.outer(t, t) / (t @ t)
    return out
