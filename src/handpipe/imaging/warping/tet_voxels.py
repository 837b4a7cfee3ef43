"""Voxels inside of tetrahedra, with what the corners carry interpolated to them."""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.core import Array, Int32Array, IntArray

EDGE = -1e-9  # least barycentric weight: centres on a face between two tets belong to one of them


@njit(cache=True)
def interpolate_in_tets(
    corners: Array, carried: Array, tets: IntArray, slots: Int32Array, free: Array, out: Array
) -> int:
    """Fill `out` (k, 3) at the free voxels whose centres lie in a tet; return the number of tets left out.

    corners (n, 3): vertices in voxels. carried (n, 3): what each vertex carries. slots (nx, ny, nz): row of
    each voxel in `free` (k,) and `out`, -1 for none. A tet that is inverted or flat is left out: it maps two
    ways onto one place. Filled voxels are no longer free.
    """
    nx, ny, nz = slots.shape
    left_out = 0
    weights = np.empty(4)
    for e in range(len(tets)):
        a, b, c, d = corners[tets[e, 0]], corners[tets[e, 1]], corners[tets[e, 2]], corners[tets[e, 3]]
        volume = _six_volumes(a, b, c, d)
        if volume <= 0:
            left_out += 1
            continue
        low, high = np.empty(3, np.int64), np.empty(3, np.int64)
        for i in range(3):
            low[i] = max(int(np.ceil(min(a[i], b[i], c[i], d[i]))), 0)
            high[i] = min(int(np.floor(max(a[i], b[i], c[i], d[i]))) + 1, slots.shape[i])
        for x in range(low[0], high[0]):
            for y in range(low[1], high[1]):
                for z in range(low[2], high[2]):
                    row = slots[x, y, z]
                    if row < 0 or not free[row]:
                        continue
                    p = np.array([float(x), float(y), float(z)])
                    weights[0] = _six_volumes(p, b, c, d) / volume
                    weights[1] = _six_volumes(a, p, c, d) / volume
                    weights[2] = _six_volumes(a, b, p, d) / volume
                    weights[3] = 1.0 - weights[0] - weights[1] - weights[2]
                    if weights.min() < EDGE:
                        continue
                    for i in range(3):
                        out[row, i] = 0.0
                        for corner in range(4):
                            out[row, i] += weights[corner] * carried[tets[e, corner], i]
                    free[row] = False
    return left_out


@njit(cache=True)
def _six_volumes(a: Array, b: Array, c: Array, d: Array) -> float:
    u, v, w = b - a, c - a, d - a
    return (
        (u[1] * v[2] - u[2] * v[1]) * w[0]
        + (u[2] * v[0] - u[0] * v[2]) * w[1]
        + (u[0] * v[1] - u[1] * v[0]) * w[2]
    )
