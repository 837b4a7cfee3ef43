"""Closed surfaces as labels of voxels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handpipe.core import BoolArray
from handpipe.imaging.volumes.volume import Volume, box
from handpipe.mesh.surfaces import Surface


def rasterise(volume: Volume, surfaces: Mapping[int, Surface]) -> NDArray[np.uint8]:
    """Labels of the voxels whose centres lie inside closed surfaces.

    Parameters
    ----------
    volume : Volume
        Volume whose grid is labelled.
    surfaces : mapping of int to Surface
        Closed surfaces that face outwards, in world mm, by label. Where two overlap, the later one wins.

    Returns
    -------
    array (nx, ny, nz) of uint8
        Label of each voxel, 0 outside all surfaces.
    """
    labels = np.zeros(volume.shape, np.uint8)
    for label, surface in surfaces.items():
        corners = volume.to_index(surface.vertices)
        lower = np.clip(np.floor(corners.min(0)).astype(np.int64), 0, volume.shape)
        upper = np.clip(np.ceil(corners.max(0)).astype(np.int64) + 1, lower, volume.shape)
        labels[box(lower, upper)][inside(volume.crop(lower, upper), surface)] = label
    return labels


def inside(volume: Volume, surface: Surface) -> BoolArray:
    """Whether the voxels' centres (nx, ny, nz) lie inside a closed surface that faces outwards."""
    crossings = _crossings(volume.to_index(surface.vertices), surface.triangles, volume.shape)
    return np.cumsum(crossings, axis=2, dtype=np.int16)[:, :, :-1] > 0


@njit(cache=True)
def _crossings(vertices, triangles, shape):  # type: ignore[no-untyped-def]
    """By voxel, how often its column enters the surface just below it, less how often it leaves.

    The crossings counted are those between the voxel below and this one. Vertices (n, 3) are in voxels. The
    sums along a column are the winding numbers.
    """
    nx, ny, nz = shape
    out = np.zeros((nx, ny, nz + 1), np.int16)
    for t in range(len(triangles)):
        a, b, c = vertices[triangles[t, 0]], vertices[triangles[t, 1]], vertices[triangles[t, 2]]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0:
            continue
        turn = 1 if area > 0 else -1
        for i in range(max(int(np.ceil(min(a[0], b[0], c[0]))), 0), min(int(max(a[0], b[0], c[0])) + 1, nx)):
            for j in range(
                max(int(np.ceil(min(a[1], b[1], c[1]))), 0), min(int(max(a[1], b[1], c[1])) + 1, ny)
            ):
                covered = True
                for e in range(3):
                    p, q = triangles[t, e], triangles[t, (e + 1) % 3]
                    covered = covered and _side(vertices, p, q, i, j) == turn
                if covered:
                    u = ((b[0] - i) * (c[1] - j) - (b[1] - j) * (c[0] - i)) / area
                    v = ((c[0] - i) * (a[1] - j) - (c[1] - j) * (a[0] - i)) / area
                    z = u * a[2] + v * b[2] + (1 - u - v) * c[2]
                    out[i, j, min(max(int(np.ceil(z)), 0), nz)] -= turn
    return out


@njit(cache=True)
def _side(vertices, p, q, x, y):  # type: ignore[no-untyped-def]
    """On which side (1 left, -1 right) of the directed edge p -> q a column lies.

    Both triangles of an edge compute the same number, so that no column slips between them; a column on the
    edge counts as moved a little along x, and less along y.
    """
    flip = 1
    if p > q:
        p, q, flip = q, p, -1
    dx, dy = vertices[q, 0] - vertices[p, 0], vertices[q, 1] - vertices[p, 1]
    cross = dx * (y - vertices[p, 1]) - dy * (x - vertices[p, 0])
    if cross == 0:
        cross = -dy if dy != 0 else dx
    return flip if cross > 0 else -flip
