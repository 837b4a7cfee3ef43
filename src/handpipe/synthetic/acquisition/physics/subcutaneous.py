"""Between skin and muscles: dermis, septa, palmar fascia, vessels and nerves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from handpipe.core import Array
from handpipe.synthetic.acquisition.image import VoxelGrid
from handpipe.synthetic.acquisition.physics.anatomy import Layer
from handpipe.synthetic.acquisition.physics.effects import Effects
from handpipe.synthetic.acquisition.physics.fields import Field, Lengths, sheet, strand, vanishing
from handpipe.synthetic.acquisition.physics.streams import Streams

CELLS: Lengths = (6.0, 5.0, 5.0)  # mm of the lobules of fat
ALONG: Lengths = (45.0, 8.0, 8.0)  # mm over which strands wind; most run along the limb
STRANDS = (1.8, 8.0)  # mm below the skin
FASCIA = 3.0  # mm below the palm's skin
STRANDS_OF = {"vessels_void": "flow void", "vessels_bright": "blood", "nerves": "nerve"}


def skin_depth(inside: Field, spacing: float) -> Field:
    """Depth in mm below the skin, 0 outside, of a share (nx, ny, nz) inside it."""
    padded = np.pad(inside > 0.5, 1, mode="edge")  # a cut end is no skin
    depth = ndimage.distance_transform_edt(padded)[1:-1, 1:-1, 1:-1].astype(np.float32)
    return np.maximum(depth - 0.5, 0.0) * np.float32(spacing)


def subcutaneous(
    inside: Field, grid: VoxelGrid, palm: Array, effects: Effects, streams: Streams
) -> Iterator[Layer]:
    """Layers over the fat that fills the skin, below muscles and bones."""
    depth, spacing = skin_depth(inside, grid.spacing), grid.spacing
    if thickness := effects.size("septa"):
        yield "fascia", inside * sheet(vanishing(grid, CELLS, streams.stream("septa")), thickness, spacing)
    if thickness := effects.size("palmar_fascia"):
        palmar = np.clip(3.0 * _facing(depth, palm), 0.0, 1.0)
        yield "fascia", palmar * sheet(np.abs(depth - FASCIA), thickness, spacing)
    there = np.clip((depth - STRANDS[0]) / spacing, 0.0, 1.0)
    there *= np.clip((STRANDS[1] - depth) / spacing, 0.0, 1.0)
    for name, tissue in STRANDS_OF.items():
        if radius := effects.size(name):  # type: ignore[arg-type]
            rng = streams.stream(name)
            distance = np.hypot(vanishing(grid, ALONG, rng), vanishing(grid, ALONG, rng))
            yield tissue, there * strand(distance, radius, spacing)
    if thickness := effects.size("skin"):
        yield "dermis", inside * np.clip(0.5 + (thickness - depth) / spacing, 0.0, 1.0)


def _facing(depth: Field, direction: Array) -> Field:
    """Cosine of the angle between a direction (3,) and the way out of the skin."""
    smoothed = ndimage.gaussian_filter(depth, 2.0)
    slopes = [np.gradient(smoothed, axis=axis) for axis in range(3)]
    size = np.sqrt(sum(s**2 for s in slopes)) + 1e-6
    return -sum(s * np.float32(d) for s, d in zip(slopes, direction, strict=True)) / size
