"""Where the boundary of what a bone claims has no shell: the image goes on as bright as the marrow.

A claim that ends across a canal is enclosed in every direction but one, and one that leaked has a boundary in
another tissue. Both have a patch of boundary without a dark layer outside.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import Array, BoolArray

SHELL = 1.0  # mm from the marrow's boundary within which the shell is dark
DARK = 0.42  # of the marrow's level: grey tissue and dim marrow are brighter
VALLEY = 0.15  # of that level: a thinner shell is darker by this than the tissue on both sides
BEYOND = 2.0  # mm outside the shell where the tissue on its far side shows


class Patch(NamedTuple):
    """The largest connected part of a boundary without a shell: area in mm^2, middle voxel (3,)."""

    area: float
    middle: Array


NOWHERE = Patch(0.0, np.zeros(3))


def open_patch(values: NDArray, claimed: BoolArray, spacing: NDArray) -> Patch:
    """The largest open patch of a claim's boundary.

    Beyond the borders of the arrays nothing is known: faces there are not open.

    Parameters
    ----------
    values : array (nx, ny, nz)
        Intensities in units of the marrow's level.
    claimed : array (nx, ny, nz) of bool
        Voxels that the bone claims.
    spacing : array (3,)
        Size of a voxel in mm.

    Returns
    -------
    Patch
        Area in mm^2 and middle voxel; `NOWHERE` if the boundary is closed.
    """
    ways = [(axis, step) for axis in range(3) for step in (1, -1)]
    shelled = {way: _shelled(values, *way, float(spacing[way[0]])) for way in ways}
    area = np.zeros(claimed.shape)
    for axis, step in ways:
        others = [float(spacing[c]) for c in range(3) if c != axis]
        area += _open_faces(claimed, shelled, axis, step) * (others[0] * others[1])
    parts, count = ndimage.label(area > 0, structure=np.ones((3, 3, 3)))
    if count == 0:
        return NOWHERE
    sums = ndimage.sum_labels(area, parts, np.arange(1, count + 1))
    largest = int(np.argmax(sums)) + 1
    return Patch(float(sums[largest - 1]), np.argwhere(parts == largest).mean(axis=0))


def _shelled(values: NDArray, axis: int, step: int, spacing: float) -> BoolArray:
    """Voxels that a dark layer or a valley follows along an axis."""
    near = int(np.floor(SHELL / spacing + 0.5)) + 1
    far = near + int(np.ceil(BEYOND / spacing))
    ahead = [_shifted(values, axis, step * k, np.nan) for k in range(1, far + 1)]
    lowest = np.fmin.reduce(ahead[:near])
    beyond = np.fmax.reduce(ahead[1:])
    dark = ~(lowest >= DARK)
    valley = lowest < np.fmin(values, beyond) - VALLEY
    return dark | valley


def _open_faces(
    claimed: BoolArray, shelled: Mapping[tuple[int, int], BoolArray], axis: int, step: int
) -> BoolArray:
    """Claimed voxels whose next voxel along an axis is not claimed, and that nothing closes there.

    A boundary aslant to the grid is a stair. Its risers look along a shell that is hardly thicker than a
    voxel, and do not meet it: they are closed where the tread above the next voxel is closed.
    """
    border = claimed & ~_shifted(claimed, axis, step, True)
    riser = np.zeros_like(border)
    for across in (c for c in range(3) if c != axis):
        for up in (1, -1):
            tread = claimed & shelled[across, -up]
            riser |= _shifted(_shifted(tread, axis, step, False), across, up, False)
    return border & ~shelled[axis, step] & ~riser


def _shifted(array: NDArray, axis: int, by: int, fill: float) -> NDArray:
    """The array's values `by` voxels farther along an axis; `fill` beyond its end."""
    out = np.full_like(array, fill)
    if abs(by) >= array.shape[axis]:
        return out
    target, source = [slice(None)] * 3, [slice(None)] * 3
    target[axis] = slice(None, -by) if by > 0 else slice(-by, None)
    source[axis] = slice(by, None) if by > 0 else slice(None, by)
    out[tuple(target)] = array[tuple(source)]
    return out
