"""Directions of an image's edges, whatever is bright and whatever is dark (Haber and Modersitzki 2006)."""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import Array

BLUR = 0.8  # voxels, of the gradients


def edge_directions(values: NDArray) -> Array:
    """Products (6, nx, ny, nz) of the components of each voxel's gradient over its length.

    A gradient and its opposite give the same. Where the image is flat beside its median gradient, all are
    near zero.
    """
    order = np.eye(3, dtype=int)
    slope = np.stack([ndimage.gaussian_filter(values, BLUR, order=axis) for axis in order])
    square = (slope**2).sum(axis=0)
    length = square + max(float(np.median(square)), float(np.finfo(np.float32).tiny))
    pairs = combinations_with_replacement(range(3), 2)
    return np.stack([(1.0 if i == j else np.sqrt(2)) * slope[i] * slope[j] / length for i, j in pairs])
