"""Around and within bones: joint cartilage and synovial fluid, trabecular texture of marrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from handpipe.core import Array
from handpipe.synthetic.acquisition.image import Surface, VoxelGrid, local_distance
from handpipe.synthetic.acquisition.physics.anatomy import Layer
from handpipe.synthetic.acquisition.physics.fields import Field, smooth

CARTILAGE = 0.8  # mm on each bone
TRABECULA = 0.7  # mm, the texture's scale
SHAFT = 0.15  # of the trabecular tissue at a bone's ends


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
    """Share of trabecular tissue in marrow (nx, ny, nz): `most` on average at the ends of bones."""
    share = np.zeros(grid.shape, np.float32)
    for points, _ in bones:
        low = np.clip(np.floor(grid.indices(points.min(axis=0))).astype(int), 0, grid.shape)
        high = np.clip(np.ceil(grid.indices(points.max(axis=0))).astype(int) + 1, 0, grid.shape)
        block = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
        share[block] = np.maximum(share[block], _ends(points, grid, low, high))
    texture = smooth(grid, (TRABECULA,) * 3, rng)
    share *= most * (1.0 + 0.6 * texture)
    return marrow * np.clip(share, 0.0, 1.0)


def _ends(points: Array, grid: VoxelGrid, low: Array, high: Array) -> Field:
    """From `SHAFT` in the middle to 1 at the ends of a bone of points (n, 3), in a block of voxels.

    0 beyond the bone's box along its axes.
    """
    middle = points.mean(axis=0)
    axes = np.linalg.svd(points - middle, full_matrices=False)[2]
    reach = np.abs((points - middle) @ axes.T).max(axis=0)
    at = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), axis=-1) * grid.spacing
    local = np.abs((at + grid.origin - middle) @ axes.T) / reach
    rise = np.clip((local[..., 0] - 0.4) / 0.4, 0.0, 1.0)
    return ((SHAFT + (1.0 - SHAFT) * rise) * (local <= 1.05).all(axis=-1)).astype(np.float32)
