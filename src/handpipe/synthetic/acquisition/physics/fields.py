"""Smooth random functions on a grid, the sheets where one vanishes and the strands where two do.

Values come from random coefficients of cubic B-splines on a lattice of lengths in mm, whatever the voxels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array
from handpipe.synthetic.acquisition.image import VoxelGrid

Field = NDArray[np.float32]
Lengths = tuple[float, float, float]


def smooth(grid: VoxelGrid, lengths: Lengths, rng: np.random.Generator) -> Field:
    """Values (nx, ny, nz) of a function that varies over some lengths in mm, of unit variance about zero."""
    bases = _bases(grid, lengths)
    values = _spread(rng.standard_normal([b.shape[1] for b in bases]), bases)
    values /= max(float(values.std()), 1e-6)
    return values


def vanishing(grid: VoxelGrid, lengths: Lengths, rng: np.random.Generator) -> Field:
    """Distance in mm (nx, ny, nz) to where a random function vanishes, to first order."""
    bases = _bases(grid, lengths)
    coefficients = rng.standard_normal([b.shape[1] for b in bases])
    values, slope = _spread(coefficients, bases), np.zeros(grid.shape, np.float32)
    for axis in range(3):
        steep = [np.gradient(b, grid.spacing, axis=0) if a == axis else b for a, b in enumerate(bases)]
        slope += _spread(coefficients, steep) ** 2
    np.sqrt(slope, out=slope)
    typical = max(float(slope.mean()), 1e-6)
    return (np.abs(values) / np.maximum(slope, 0.2 * typical)).astype(np.float32)


def sheet(distance: Field, thickness: float, spacing: float) -> Field:
    """Share of each voxel within a sheet of a thickness in mm, by distances in mm to its middle."""
    half = 0.5 * thickness
    upper = np.minimum(half, distance + 0.5 * spacing)
    lower = np.maximum(-half, distance - 0.5 * spacing)
    return np.clip((upper - lower) / spacing, 0.0, 1.0).astype(np.float32)


def strand(distance: Field, radius: float, spacing: float) -> Field:
    """Share of each voxel within a strand of a radius in mm, by distances in mm to its middle."""
    full = min(1.0, np.pi * radius**2 / spacing**2)
    return (full * np.clip(0.5 - (distance - radius) / spacing, 0.0, 1.0)).astype(np.float32)


def _bases(grid: VoxelGrid, lengths: Lengths) -> list[Field]:
    return [
        _splines(np.arange(n, dtype=np.float64) * (grid.spacing / length))
        for n, length in zip(grid.shape, lengths, strict=True)
    ]


def _splines(at: Array) -> Field:
    """Cubic B-splines (n, m) on a lattice of unit steps at places (n,)."""
    knots = np.arange(-1, int(np.ceil(at[-1])) + 3)
    t = np.abs(at[:, None] - knots)
    near, far = 2.0 / 3.0 - t**2 + 0.5 * t**3, (2.0 - t) ** 3 / 6.0
    return np.where(t < 1.0, near, np.where(t < 2.0, far, 0.0)).astype(np.float32)


def _spread(coefficients: Array, bases: list[Field]) -> Field:
    x, y, z = bases
    return np.einsum("abc,xa,yb,zc->xyz", coefficients.astype(np.float32), x, y, z, optimize=True)
