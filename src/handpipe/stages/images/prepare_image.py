"""A real limb's image in the build's unit, without the coil's shading."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from handpipe.core import Array
from handpipe.core.configuration import Dataset
from handpipe.imaging.volumes import Volume, read_volume, without_shading, write_volume

log = logging.getLogger(__name__)


def prepare_image(source: Path, output: Path, dataset: Dataset) -> None:
    """A real limb's image in the build's unit, without the coil's shading."""
    acquired = read_volume(source)
    volume = Volume(acquired.values, build_scale(dataset) @ acquired.affine)
    even = without_shading(volume)
    inside = volume.values > np.median(volume.values)
    field = volume.values[inside] / np.maximum(even.values[inside], 1e-6)
    low, high = np.percentile(field, [1, 99])
    log.info("%s: the coil's shading changes levels by a factor of %.1f", source.name, high / low)
    write_volume(output, even)


def build_scale(dataset: Dataset) -> Array:
    """From units of the headers to mm of the build (4, 4)."""
    assert dataset.limb is not None
    return np.diag([dataset.limb.unit / dataset.limb.shrunk] * 3 + [1.0])
