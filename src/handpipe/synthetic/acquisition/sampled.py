"""Implicit functions of real surfaces: distances sampled on a grid, and what keeps bodies apart by them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.mesh.surfaces import averaging
from handpipe.synthetic.acquisition import image
from handpipe.synthetic.geometry.implicit import Implicit

Surface = tuple[Array, IntArray]


def interpolated(values: Array, grid: image.VoxelGrid) -> Implicit:
    """Trilinear function of values on a grid; beyond it, the nearest value."""

    def value(points: Array) -> Array:
        return map_coordinates(values, grid.indices(points).T, order=1, mode="nearest")

    return value


def of_surface(surface: Surface, spacing: float = 0.4, reach: float = 4.0) -> Implicit:
    """Signed distance to a closed surface, sampled at `spacing` and cut off at +-`reach` mm."""
    grid = image.VoxelGrid.around(surface[0], reach + spacing, spacing)
    return interpolated(image.signed_distance(surface, grid, reach), grid)


def of_line(line: Array, radius: float) -> Implicit:
    """Distance to a tube of a radius about points (n, 3) that lie close together."""
    tree = cKDTree(line)
    return lambda points: tree.query(points)[0] - radius


def moved(shape: Implicit, transform: RigidTransform) -> Implicit:
    """The shape carried along by a transform."""
    inverse = transform.inverse()
    return lambda points: shape(inverse(points))


def kept_off(
    points: Array, triangles: IntArray, obstacles: Sequence[Implicit], distance: float, rounds: int = 8
) -> Array:
    """Vertices (n, 3) of a surface pushed off obstacles to `distance` away, their shifts spread smoothly."""
    average = averaging(Mesh(points, triangles))
    result = points.copy()
    for number in range(rounds):
        shift = np.zeros_like(result)
        for shape in obstacles:
            close = np.flatnonzero(shape(result + shift) < distance)
            if len(close):
                shift[close] += _outwards(shape, (result + shift)[close], distance)
        spread = shift
        if number < rounds - 2:  # the last rounds push without smoothing, so that the distance is kept
            for _ in range(3):
                spread = average @ spread
            larger = np.linalg.norm(spread, axis=1) > np.linalg.norm(shift, axis=1)
            spread = np.where(larger[:, None], spread, shift)
        result += spread
    return result


def _outwards(shape: Implicit, points: Array, distance: float) -> Array:
    """Step along the gradient that brings points (n, 3) to the level `distance`."""
    step = 0.2 * np.eye(3)
    slope = np.stack([shape(points + e) - shape(points - e) for e in step], axis=1) / 0.4
    slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 0.3)
    return np.maximum(distance - shape(points), 0.0)[:, None] * slope
