"""The volume of a generated pose, by the image model that its dataset names."""

from __future__ import annotations

import logging
import zlib
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from handpipe.core.configuration import Dataset, Images, Scanner
from handpipe.synthetic.acquisition import image
from handpipe.synthetic.acquisition.physics import Effects, ImagedAnatomy, Sequence, scan

log = logging.getLogger(__name__)


def imaged(
    dataset: Dataset,
    pose: str,
    anatomy: ImagedAnatomy,
    grid: image.VoxelGrid,
    rng: np.random.Generator,
    *,
    levels: Mapping[str, float] = image.INTENSITIES,
    scanner: Scanner | None = None,
) -> NDArray:
    """Image (nx, ny, nz) of a pose; levels, scanner and rng are the painted model's alone."""
    if dataset.images is None or dataset.images.model == "painted":
        known = scanner or Scanner()
        clean = image.paint_layers(anatomy.layers, levels, grid)
        return image.acquire(clean, grid, rng, bias=known.bias, noise=known.noise)[0]
    sequence, effects = sequence_of(dataset.images), effects_of(dataset.images)
    log.info("%s: %s", pose, sequence)
    return scan(anatomy, grid, sequence, effects, [dataset.seed, zlib.crc32(pose.encode()), 6])


def sequence_of(images: Images) -> Sequence:
    """The pulse sequence that a dataset names."""
    return Sequence.named(images.sequence, images.field)


def effects_of(images: Images) -> Effects:
    """The effects that a dataset asks for."""
    return Effects(images.effects, images.strength)
