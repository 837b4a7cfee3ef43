"""An image as small integers on a coarse grid around a hand, for a page that shows slices of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from handpipe.core import Array
from handpipe.imaging.volumes import Volume

VOXELS = 3_000_000  # at most: a byte each, 4 MB as text where they do not compress
MARGIN = 1.0  # mm of the grid around the hand
WHITE = 99.5  # percentile of the values that is shown as white
BLUR = 0.4  # deviation by the grid's spacing, where this is coarser than the image's


def packed_image(image: Volume, points: Array) -> tuple[dict[str, Any], NDArray[np.uint8]]:
    """Sample an image around points.

    Parameters
    ----------
    image : Volume
        Image in the frame of the points.
    points : array (n, 3)
        Points of the hand in mm.

    Returns
    -------
    grid : dict
        `shape` (3,), `spacing` in mm, and `origin` (3,) of the first voxel's centre in mm, along the axes.
    values : array (k,) of uint8
        Intensities, the last axis fastest; 0 beyond the image.
    """
    lower, upper = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    finest = float(image.spacing.min())
    spacing = max(finest, float(np.cbrt(np.prod(upper - lower) / VOXELS)))
    shape = np.maximum(np.floor((upper - lower) / spacing).astype(int), 1) + 1
    while np.prod(shape) > VOXELS:
        spacing *= 1.01
        shape = np.floor((upper - lower) / spacing).astype(int) + 1
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, 3)
    places = lower + spacing * grid
    blur = BLUR * np.sqrt(max(spacing**2 - finest**2, 0.0)) / image.spacing
    values = image.like(gaussian_filter(image.values, blur)).sample(places)
    indices = image.to_index(places)
    inside = ((indices >= -0.5) & (indices <= np.array(image.shape) - 0.5)).all(axis=1)
    dark, white = np.percentile(values[inside], (0, WHITE)) if inside.any() else (0.0, 1.0)
    grey = np.clip((values - dark) / max(white - dark, np.finfo(float).tiny), 0, 1)
    packed = np.where(inside, np.rint(255 * grey), 0).astype(np.uint8)
    return {"shape": shape.tolist(), "spacing": spacing, "origin": lower.tolist()}, packed
