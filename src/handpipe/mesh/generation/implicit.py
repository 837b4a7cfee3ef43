"""From implicit functions to closed surfaces: grids, isosurfaces, unions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from skimage.measure import marching_cubes

from handpipe.core import Array, HandpipeError
from handpipe.mesh.contact import distance_to
from handpipe.mesh.generation.remeshing import relax, remesh
from handpipe.mesh.surfaces.surface import Surface

__all__ = ["Grid", "isosurface", "relax", "remesh", "signed_distance", "smooth_minimum", "union_surface"]
EDGE = 1.2  # of the grid spacing: edges of a surface, where no length is given


@dataclass(frozen=True)
class Grid:
    """Points origin + spacing * (i, j, k) for (i, j, k) below shape.

    Parameters
    ----------
    origin : array (3,)
        First point in mm.
    spacing : float
        Distance of neighbouring points in mm, along every axis.
    shape : tuple of three int
        Number of points along each axis.
    """

    origin: Array
    spacing: float
    shape: tuple[int, int, int]

    @staticmethod
    def around(points: Array, margin: float, spacing: float) -> Grid:
        """The grid around points and a margin, on multiples of the spacing.

        Parameters
        ----------
        points : array (n, 3)
            Points in mm.
        margin, spacing : float
            Least distance from the points to the border, and distance of neighbouring grid points, in mm.

        Returns
        -------
        Grid
        """
        low = np.floor((points.min(axis=0) - margin) / spacing).astype(int)
        high = np.ceil((points.max(axis=0) + margin) / spacing).astype(int)
        nx, ny, nz = (int(n) for n in high - low + 1)
        return Grid(low * spacing, spacing, (nx, ny, nz))

    def points(self) -> Array:
        """All points (n, 3), the last coordinate fastest: values (n,) reshape to `shape`."""
        return self.origin + self.spacing * np.indices(self.shape).reshape(3, -1).T


def isosurface(values: Array, grid: Grid, level: float = 0.0) -> Surface:
    """The surface of the region below a level, closed and facing outwards.

    Where the region reaches the grid's border, the surface is closed half a spacing beyond it.

    Parameters
    ----------
    values : array (n,) or array of the grid's shape
        Values at the grid's points, of any unit.
    grid : Grid
        Places of the values.
    level : float
        Value on the surface, in the unit of `values`.

    Returns
    -------
    Surface
        Vertices in mm.

    Raises
    ------
    HandpipeError
        Where no value is below the level.
    """
    values = np.asarray(values, dtype=np.float64).reshape(grid.shape)
    if not values.min() < level:
        raise HandpipeError(
            f"isosurface: no value below {level:g} (the least is {values.min():g}); check the level"
        )
    # Values exactly on the level make triangles without area: shift them by a millionth of the range.
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
    """Signed distances from the points of a grid to a surface, exact near the surface.

    Parameters
    ----------
    surface : Surface
        Closed surface, which may cut itself as muscles do that fold.
    grid : Grid
        Points at which distances are computed.
    band : float
        Distance in mm from the surface's bounding box within which the result is exact.

    Returns
    -------
    array (n,)
        Distances in mm, negative inside. Beyond `band` they are the distance to the box: positive, too small,
        but above `band`.
    """
    points = grid.points()
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    values = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0), axis=1)
    near = values <= band
    values[near] = distance_to(surface).signed(points[near])[0]
    return values


def smooth_minimum(a: Array, b: Array, width: float) -> Array:
    """The minimum of two fields, rounded where they are close to each other.

    Parameters
    ----------
    a, b : array
        Distances in mm, of one shape.
    width : float
        Difference in mm below which the minimum is rounded; with 0 it is the plain minimum.

    Returns
    -------
    array
        Distances in mm, of the same shape; by a quarter of `width` at most below the plain minimum.
    """
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
    """The surface of the union of closed surfaces.

    Parameters
    ----------
    surfaces : list of Surface
        At least one closed surface.
    spacing : float
        Spacing in mm of the grid on which the union is computed.
    offset : float
        Distance in mm by which the union is grown; negative shrinks it.
    smooth : float
        Difference of distances in mm below which the union is rounded where surfaces meet.
    edge_length : float
        Edge length of the triangles in mm; 0 stands for 1.2 times the spacing.

    Returns
    -------
    Surface
        Closed, facing outwards, vertices in mm.

    Raises
    ------
    HandpipeError
        Where nothing is left of a union that shrinks.
    """
    band = max(offset, 0.0) + smooth + 2 * spacing
    grid = Grid.around(np.concatenate([s.vertices for s in surfaces]), band, spacing)
    values = signed_distance(surfaces[0], grid, band)
    for surface in surfaces[1:]:
        values = smooth_minimum(values, signed_distance(surface, grid, band), smooth)
    return remesh(isosurface(values, grid, offset), edge_length or EDGE * spacing)
