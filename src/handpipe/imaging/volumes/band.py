"""Signed distance to a closed surface on a grid: exact in a band around it, its bound beyond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from handpipe.core import Array, IntArray
from handpipe.imaging.volumes.rasterisation import inside
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Distance, Surface, barycentric_weights


@dataclass(frozen=True)
class DistanceBand:
    """Signed distances to a surface in a band of voxels around it.

    Attributes
    ----------
    signed : (nx, ny, nz)
        Signed distance in mm, negative inside, +-reach beyond the band.
    indices : (m, 3)
        Indices of the voxels in the band.
    triangles : (m,)
        The closest triangles to these voxels.
    closest : (m, 3)
        The closest points to these voxels.
    """

    signed: Array
    indices: IntArray
    triangles: IntArray
    closest: Array

    @staticmethod
    def around(surface: Surface, grid: Volume, reach: float, inwards: float | None = None) -> DistanceBand:
        """The band around a surface on a volume's grid.

        Parameters
        ----------
        surface : Surface
            Closed surface in world mm.
        grid : Volume
            Volume whose grid is used.
        reach : float
            Distance in mm to which the band reaches; longer than the surface's edges.
        inwards : float, optional
            Distance in mm to which it reaches inside the surface, if less.

        Returns
        -------
        DistanceBand
            Signed distances and the voxels of the band.
        """
        points, within = grid.to_index(surface.vertices), inside(grid, surface)
        near = _around_points(points, reach / grid.spacing, grid.shape)
        if inwards is not None:
            near &= ~within | _around_points(points, inwards / grid.spacing, grid.shape)
        indices = np.argwhere(near)
        signed, triangles, closest, _ = Distance(surface).signed(grid.to_world(indices))
        field = np.where(within, -reach, reach)
        field[near] = np.clip(signed, -reach, reach)
        return DistanceBand(field, indices, triangles, closest)


@njit(cache=True)
def _around_points(points, radii, shape):  # type: ignore[no-untyped-def]
    """Mask (nx, ny, nz) of the voxels within an ellipsoid of radii (3,) in voxels around any point (n, 3)."""
    near = np.zeros(shape, np.bool_)
    low, high = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for p in range(len(points)):
        for c in range(3):
            low[c] = max(int(np.ceil(points[p, c] - radii[c])), 0)
            high[c] = min(int(np.floor(points[p, c] + radii[c])), shape[c] - 1)
        for i in range(low[0], high[0] + 1):
            x = ((i - points[p, 0]) / radii[0]) ** 2
            for j in range(low[1], high[1] + 1):
                rest = 1 - x - ((j - points[p, 1]) / radii[1]) ** 2
                if rest < 0:
                    continue
                half = np.sqrt(rest) * radii[2]
                first = max(int(np.ceil(points[p, 2] - half)), low[2])
                last = min(int(np.floor(points[p, 2] + half)), high[2])
                near[i, j, first : last + 1] = True
    return near


def at_closest(surface: Surface, triangles: IntArray, points: Array, values: Array) -> Array:
    """Vertex values (n,) interpolated at points (m, 3) on given triangles (m,)."""
    corners = surface.triangles[triangles]
    weights = barycentric_weights(points, surface.vertices[corners])
    return np.einsum("ij,ij->i", weights, values[corners])
