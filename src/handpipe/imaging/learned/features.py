"""What a voxel looks like: local level, edges, curvature and texture at several scales, in every channel.

A channel is divided by its own mean over some centimetres first: the fall-off of a receive coil cancels, and
what remains is how bright a tissue is beside its surroundings.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import Array, BoolArray
from handpipe.imaging.volumes import Volume

SURROUNDINGS = 15.0  # mm, of the mean that levels are relative to
AIR = 0.1  # of bright tissue: darker surroundings are no reference
SCALES = (1.5, 3.0)  # mm, of levels, edges and curvature
COARSE = 6.0  # mm, of a level alone
TEXTURE = 2.5  # mm, within which intensities vary
AXES = 3  # the last columns of the features: a voxel's place
LEAST_NEAR = 1e-3  # share of surroundings that are brighter than air, by which a mean is divided at least


def relative(volume: Volume) -> NDArray[np.float32]:
    """Intensities over their mean in the surroundings: without a coil's fall-off.

    Parameters
    ----------
    volume : Volume
        One channel.

    Returns
    -------
    array (nx, ny, nz) of float32
        1 where a voxel is as bright as the tissue around it.
    """
    values = volume.values.astype(np.float32)
    least = AIR * max(volume.bright, float(np.finfo(np.float32).tiny))
    lit = (values > least).astype(np.float32)
    width = SURROUNDINGS / volume.spacing
    near = ndimage.gaussian_filter(lit, width)
    mean = ndimage.gaussian_filter(values * lit, width) / np.maximum(near, LEAST_NEAR)
    return np.asarray(values / np.maximum(mean, least), np.float32)


def features(channels: Sequence[Volume], at: BoolArray) -> NDArray[np.float32]:
    """What the voxels of a mask look like.

    Parameters
    ----------
    channels : sequence of Volume
        Images on one grid.
    at : array (nx, ny, nz) of bool
        The voxels that are asked for.

    Returns
    -------
    array (n, f) of float32
        For each voxel of the mask and each channel: its relative level at four scales, the gradient's length
        and the Hessian's eigenvalues at two, and its texture. The last `AXES` columns are its place in mm.
    """
    columns = [c for volume in channels for c in _columns(relative(volume), volume.spacing, at)]
    return np.column_stack([*columns, channels[0].to_world(np.argwhere(at))]).astype(np.float32)


def _columns(values: NDArray, spacing: Array, at: BoolArray) -> Iterator[NDArray]:
    """The features (n,) of one channel."""
    yield values[at]
    yield ndimage.gaussian_filter(values, COARSE / spacing)[at]
    for scale in SCALES:
        width = scale / spacing
        yield ndimage.gaussian_filter(values, width)[at]
        yield ndimage.gaussian_gradient_magnitude(values, width)[at]
        yield from _curvatures(values, width, at).T
    yield _texture(values, TEXTURE / spacing)[at]


def _curvatures(values: NDArray, width: Array, at: BoolArray) -> NDArray:
    """Eigenvalues (n, 3) of the Hessian in units of the scale, smallest first."""
    hessian = np.empty((np.count_nonzero(at), AXES, AXES), np.float32)
    for a in range(AXES):
        for b in range(a, AXES):
            order = [(a == c) + (b == c) for c in range(AXES)]
            second = ndimage.gaussian_filter(values, width, order=order)[at]
            hessian[:, a, b] = hessian[:, b, a] = second * (width[a] * width[b])
    return np.asarray(np.linalg.eigvalsh(hessian))


def _texture(values: NDArray, width: Array) -> NDArray:
    """Deviation of the intensities around a voxel."""
    mean = ndimage.gaussian_filter(values, width)
    square = ndimage.gaussian_filter(values**2, width)
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0)))
