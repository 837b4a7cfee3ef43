"""Before sampling: the coil's sensitivity, distortion by the static field, slices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array
from handpipe.synthetic.acquisition.image import VoxelGrid
from handpipe.synthetic.acquisition.physics.fields import Field, smooth

PATCH = 40.0  # mm over which the static field varies after shimming


def coil_sensitivity(grid: VoxelGrid, far: float, rng: np.random.Generator) -> Field:
    """Sensitivity of a loop beside the grid: 1 at the near side, `far` at the other one, on its axis.

    The field of a loop of radius R falls as (1 + (t / R)^2)^(-3/2) with the distance t along its axis.
    """
    direction = rng.standard_normal(3) * (0.3, 1.0, 1.0)  # mostly across the limb
    direction /= np.linalg.norm(direction)
    t = np.zeros(grid.shape, np.float32)
    for axis, (n, d) in enumerate(zip(grid.shape, direction, strict=True)):
        along = np.arange(n, dtype=np.float32) * np.float32(grid.spacing * abs(d))
        t += (along if d > 0 else along[::-1]).reshape([-1 if a == axis else 1 for a in range(3)])
    ratio = t * np.float32(np.sqrt(far ** (-2.0 / 3.0) - 1.0) / max(float(t.max()), 1e-6))
    return (1.0 + ratio**2) ** np.float32(-1.5)


def field_shift(grid: VoxelGrid, voxels: float, rng: np.random.Generator) -> Field:
    """Shift along the readout in voxels, at most `voxels`, by a smooth deviation of the static field."""
    shift = smooth(grid, (PATCH,) * 3, rng)
    return shift * np.float32(voxels / max(float(np.abs(shift).max()), 1e-6))


def distorted(image: Field, shift: Field) -> Field:
    """An image whose signal moves along the first axis by a shift in voxels and keeps its sum."""
    n = image.shape[0]
    at = np.clip(np.arange(n, dtype=np.float32)[:, None, None] - shift, 0.0, n - 1.0)
    below = np.minimum(at.astype(np.int32), n - 2)
    share = at - below
    lower = np.take_along_axis(image, below, axis=0)
    upper = np.take_along_axis(image, below + 1, axis=0)
    return (lower + share * (upper - lower)) * (1.0 - np.gradient(shift, axis=0))


def profile(n: int, width: float) -> Array:
    """Weights (n, n) of slices by a Gaussian of a full width at half maximum in voxels; rows sum to 1."""
    apart = np.arange(n)[:, None] - np.arange(n)
    weights = np.exp(-4.0 * np.log(2.0) * (apart / width) ** 2)
    return weights / weights.sum(axis=1, keepdims=True)


def slices(n: int, thickness: float) -> Array:
    """Weights (n, n) of voxels that are cut into slices of a thickness in voxels and interpolated back."""
    count = int(np.ceil(n / thickness))
    start = np.arange(count)[:, None] * thickness - 0.5
    voxel = np.arange(n) - 0.5
    overlap = np.minimum(start + thickness, voxel + 1.0) - np.maximum(start, voxel)
    mean: NDArray = np.clip(overlap, 0.0, 1.0)
    mean /= mean.sum(axis=1, keepdims=True)
    at = np.clip((np.arange(n) + 0.5) / thickness - 0.5, 0.0, count - 1.0)
    back = np.clip(1.0 - np.abs(at[:, None] - np.arange(count)), 0.0, 1.0)
    return back @ mean
