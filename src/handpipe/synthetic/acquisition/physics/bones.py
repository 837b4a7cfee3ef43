"""Around and within bones: joint cartilage and synovial fluid, trabecular texture of marrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.ndimage import map_coordinates

from handpipe.core import Array
from handpipe.synthetic.acquisition.image import Surface, VoxelGrid, local_distance, local_occupancy
from handpipe.synthetic.acquisition.physics.anatomy import Layer
from handpipe.synthetic.acquisition.physics.fields import Field

CARTILAGE = 0.8  # mm on each bone
TRABECULA = 0.7  # mm, the texture's scale
SHAFT = 0.15  # of the trabecular tissue at a bone's ends
SPREAD = (151.0 / 315.0) ** 1.5  # of cubic B-splines with coefficients of unit variance


def joint_layers(bones: Sequence[Surface], grid: VoxelGrid, width: float) -> Iterator[Layer]:
    """Fluid and cartilage where two bones are at most a width in mm apart, to be painted before bones."""
    first = np.full(grid.shape, width, np.float32)
    second = first.copy()
    for bone in bones:
        if found := local_distance(bone, grid, width):
            block, distance = found
            second[block] = np.minimum(second[block], np.maximum(first[block], distance))
            first[block] = np.minimum(first[block], distance)
    gap = np.clip(0.5 + (width - np.maximum(first, 0.0) - second) / grid.spacing, 0.0, 1.0)
    gap[second >= width] = 0.0
    yield "fluid", gap
    layer = np.minimum(CARTILAGE, 0.5 * (first + second))
    yield "cartilage", gap * np.clip(0.5 + (layer - first) / grid.spacing, 0.0, 1.0)


def trabecular_share(
    marrow: Field, bones: Sequence[Surface], grid: VoxelGrid, most: float, rng: np.random.Generator
) -> Field:
    """Share of trabecular tissue in marrow (nx, ny, nz): `most` on average at the ends of bones.

    The texture is fixed to each bone: one stream and the same vertices give the same texture in every pose.
    """
    share = np.zeros(grid.shape, np.float32)
    for bone, stream in zip(bones, rng.spawn(len(bones)), strict=True):
        for block, inside in local_occupancy(bone, grid):
            voxels = np.argwhere(inside > 0.0) + [s.start for s in block]
            at = grid.origin + grid.spacing * voxels
            found = most * _ends(bone[0], at) * (1.0 + 0.6 * _texture(bone[0], at, stream))
            place = tuple(voxels.T)
            share[place] = np.maximum(share[place], found)
    return marrow * np.clip(share, 0.0, 1.0)


def _ends(points: Array, at: Array) -> Array:
    """From `SHAFT` in the middle to 1 at the ends of a bone of points (n, 3), at places (m, 3) in it."""
    middle = points.mean(axis=0)
    [long, *_] = np.linalg.svd(points - middle, full_matrices=False)[2]
    along = np.abs((at - middle) @ long) / np.abs((points - middle) @ long).max()
    return SHAFT + (1.0 - SHAFT) * np.clip((along - 0.4) / 0.4, 0.0, 1.0)


def _texture(points: Array, at: Array, rng: np.random.Generator) -> Array:
    """A random function of unit variance that moves with a bone's points (n, 3), at places (m, 3)."""
    middle, axes = points.mean(axis=0), _axes(points)
    own = (points - middle) @ axes.T / TRABECULA
    low, high = np.floor(own.min(axis=0)) - 2.0, np.ceil(own.max(axis=0)) + 2.0
    coefficients = rng.standard_normal((high - low).astype(int) + 1) / SPREAD
    places = (at - middle) @ axes.T / TRABECULA - low
    return map_coordinates(coefficients, places.T, order=3, prefilter=False)


def _axes(points: Array) -> Array:
    """Right-handed axes (3, 3), one a row, that turn with points (n, 3), however symmetric these are."""
    weights = np.random.default_rng(0).standard_normal((2, len(points)))
    first, second = weights @ (points - points.mean(axis=0))
    first /= np.linalg.norm(first)
    second -= first * (first @ second)
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])
