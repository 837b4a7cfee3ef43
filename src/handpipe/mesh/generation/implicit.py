"""From implicit functions to closed surfaces: grids, isosurfaces, unions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skimage.measure import marching_cubes

from handpipe.core import Array, HandpipeError
from handpipe.mesh.generation.remeshing import relax, remesh
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface

__all__ = ["Grid", "isosurface", "relax", "remesh", "signed_distance", "smooth_minimum", "union_surface"]


@dataclass(frozen=True)
class Grid:
    """Points origin + spacing * (i, j, k) for (i, j, k) below shape; origin (3,) and spacing in mm."""

    origin: Array
    spacing: float
    shape: tuple[int, int, int]

    @staticmethod
    def around(points: Array, margin: float, spacing: float) -> Grid:
        """The grid around points (n, 3) and a margin in mm, on multiples of the spacing."""
        low = np.floor((points.min(axis=0) - margin) / spacing).astype(int)
        high = np.ceil((points.max(axis=0) + margin) / spacing).astype(int)
        nx, ny, nz = (int(n) for n in high - low + 1)
        return Grid(low * spacing, spacing, (nx, ny, nz))

    def points(self) -> Array:
        """All points (n, 3), the last coordinate fastest: values (n,) reshape to `shape`."""
        return self.origin + self.spacing * np.indices(self.shape).reshape(3, -1).T


def isosurface(values: Array, grid: Grid, level: float = 0.0) -> Surface:
    """The surface of the region below a level, closed and facing outwards; values (n,) or `grid.shape`.

    Where the region reaches the grid's border, the surface is closed half a spacing beyond it. Raises
    `HandpipeError` where no value is below the level.
    """
    values = np.asarray(values, dtype=np.float64).reshape(grid.shape)
    if not values.min() < level:
        raise HandpipeError(
            f"isosurface: no value below {level:g} (the least is {values.min():g}); check the level"
        )
    # Values exactly on the level make triangles without area: shift them by far less than anyone can see.
    distance = values - level
    tiny = 1e-6 * max(float(np.abs(distance).max()), 1e-300)
    distance = np.where(np.abs(distance) < tiny, tiny, distance)
    inside = tuple(slice(1, n + 1) for n in grid.shape)
    padded = np.abs(np.pad(distance, 1, mode="edge"))
    padded[inside] = distance
    vertices, triangles, _, _ = marching_cubes(padded, 0.0, gradient_direction="ascent")
    surface = Surface(grid.origin + grid.spacing * (vertices.astype(np.float64) - 1), triangles)
    return surface if surface.volume() > 0 else surface.flipped()


def signed_distance(surface: Surface, grid: Grid, band: float) -> Array:
    """Signed distance (n,) in mm at the grid's points, exact within `band` of the surface's box.

    Farther out it is the distance to the box, which is positive, too small, but above `band`.
    """
    points = grid.points()
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    values = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1)
    near = values <= band
    values[near] = Distance(surface).signed(points[near])[0]
    return values


def smooth_minimum(a: Array, b: Array, width: float) -> Array:
    """Minimum of a and b, rounded where they differ by less than `width` (mm); the plain one for width 0."""
    if width == 0:
        return np.minimum(a, b)
    overlap = np.maximum(width - np.abs(a - b), 0) / width
    return np.minimum(a, b) - 0.25 * width * overlap**2


def union_surface(
    surfaces: list[Surface],
    spacing: float,
    offset: float = 0.0,
    *,
    smooth: float = 0.0,
    edge_length: float = 0.0,
) -> Surface:
    """Surface of the union of closed surfaces, grown by `offset`, rounded where they meet by `smooth` (mm).

    `spacing` is that of the grid; the triangles have `edge_length`, or 1.2 times the spacing.
    """
    band = max(offset, 0.0) + smooth + 2 * spacing
    grid = Grid.around(np.concatenate([s.vertices for s in surfaces]), band, spacing)
    values = signed_distance(surfaces[0], grid, band)
    for surface in surfaces[1:]:
        values = smooth_minimum(values, signed_distance(surface, grid, band), smooth)
    return remesh(isosurface(values, grid, offset), edge_length or 1.2 * spacing)
