"""Signed distance to a closed surface on a grid: exact in a band around it, its bound beyond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.imaging.volume import Volume
from handpipe.mesh.distance import Distance
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class DistanceBand:
    """signed (nx, ny, nz) in mm, negative inside, +-reach beyond the band; in the band the voxels' indices
    (m, 3), the closest triangles (m,) and the closest points (m, 3)."""

    signed: Array
    indices: IntArray
    triangles: IntArray
    closest: Array

    @staticmethod
    def around(surface: Surface, grid: Volume, reach: float) -> DistanceBand:
        """The band of `reach` mm, longer than the surface's edges, on a volume's grid of cubic voxels."""
        near = np.zeros(grid.shape, bool)
        corners = np.round(grid.to_index(surface.vertices)).astype(np.int64)
        near[tuple(np.clip(corners, 0, np.array(grid.shape) - 1).T)] = True
        within = ndimage.distance_transform_edt(~near, sampling=grid.spacing) < reach
        indices = np.argwhere(within)
        signed, triangles, closest, _ = Distance(surface).signed(grid.to_world(indices))
        field = np.zeros(grid.shape)
        field[tuple(indices.T)] = signed
        nearest = ndimage.distance_transform_edt(~within, return_distances=False, return_indices=True)
        field = np.where(within, field, reach * np.sign(field[tuple(nearest)]))
        return DistanceBand(field, indices, triangles, closest)


def at_closest(surface: Surface, triangles: IntArray, points: Array, values: Array) -> Array:
    """Vertex values (n,) interpolated at points (m, 3) on given triangles (m,)."""
    corners = surface.triangles[triangles]
    a, b, c = np.moveaxis(surface.vertices[corners], 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-300)
    weights = np.stack(
        [
            np.einsum("ij,ij->i", np.cross(c - b, points - b), normal) / squared,
            np.einsum("ij,ij->i", np.cross(a - c, points - c), normal) / squared,
            np.einsum("ij,ij->i", np.cross(b - a, points - a), normal) / squared,
        ],
        axis=1,
    )
    return np.einsum("ij,ij->i", weights, values[corners])
