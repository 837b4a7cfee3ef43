"""Along which axes a volume has been interpolated: its spectrum ends before its voxels' finest waves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from handpipe.core import Array
from handpipe.imaging.volumes.volume import Volume

STEP = 0.35  # decades by which the power falls more at the end of what was acquired than to either side
WIDTH = 0.06  # of the finest wave number, over which the power is compared on either side
LEAST = 0.5  # of the finest wave number: scanners interpolate to voxels of a half at most
BODY = 0.5  # of the highest mean along a line, from which a line passes through the body
FEWEST = 24  # voxels along an axis, of which a spectrum is told


def acquired_voxels(volume: Volume) -> Array:
    """Width of the voxels that were acquired, along each axis of the volume.

    A scanner that fills the outer part of k-space with zeros gives voxels that are smaller than what it
    resolves. The power of the image's waves then falls abruptly at the last wave that was acquired.

    Parameters
    ----------
    volume : Volume
        An image.

    Returns
    -------
    array (3,)
        Widths in mm: of the volume's voxels where no such end is found.
    """
    return np.array([h / _acquired(volume.values, axis) for axis, h in enumerate(volume.spacing)])


def _acquired(values: NDArray, axis: int) -> float:
    """Share of the wave numbers along an axis that was acquired."""
    n = values.shape[axis]
    if n < FEWEST:
        return 1.0
    lines = np.moveaxis(values, axis, -1).reshape(-1, n).astype(np.float32)
    level = lines.mean(axis=1)
    # Lines through the body: a magnitude's noise in air is not that of what was acquired.
    lines = lines[level >= BODY * np.percentile(level, 98)]
    waves = fft.rfft((lines - lines.mean()) * np.hanning(n).astype(np.float32), axis=1)
    power = np.log10(np.mean(np.abs(waves) ** 2, axis=0) + 1e-30)
    finest, width = len(power) - 1, max(round(WIDTH * n), 3)
    means = ndimage.uniform_filter1d(power, width, mode="nearest")
    ends = np.arange(width + 2, finest - width)
    # The window blurs the spectrum by a wave number to either side of its end.
    falls = means[ends - 1 - width // 2] - means[ends + 2 + width // 2]
    # Edges of tissues make the power fall everywhere, at the end of what was acquired it falls at once.
    beside = 0.5 * (_shifted(falls, width + 2) + _shifted(falls, -width - 2))
    sharp = np.where(ends >= LEAST * finest, falls - beside, 0.0)
    best = int(np.argmax(sharp))
    return float(ends[best] / finest) if sharp[best] > STEP else 1.0


def _shifted(values: Array, count: int) -> Array:
    """Values (n,) moved by a count, the first or last one repeated."""
    return values[np.clip(np.arange(len(values)) - count, 0, len(values) - 1)]
