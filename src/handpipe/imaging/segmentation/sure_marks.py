"""Marks of the random walker where a few strokes leave no doubt.

The walker finds a boundary well between dense marks, and badly far from sparse ones: the probability fades
along a canal and leaks through the many voxels of a blurred boundary. Two minimax floods, from the strokes in
the bone and from all others, show for most voxels which stroke reaches them with the smaller change of
intensity. Where the difference is clear, voxels become marks; the walker decides the others.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import Array, BoolArray
from handpipe.imaging.segmentation.minimax_flood import flood
from handpipe.imaging.segmentation.random_walker import INSIDE, OUTSIDE

CLEAR = 0.15  # of the marrow's level: difference of two floods' costs that decides
FARTHEST = 0.45  # of that level: muscle is about as much darker than marrow
PLATEAU = 0.2  # of that level below the brightest neighbour: darker voxels are part of an edge
BARRIER = 0.25  # of that level: what costs more lies behind a canal, or behind the thinnest place of a shell
DIRECT = 0.18  # of that level: what an outer stroke reaches at less is not behind a shell's thinnest place
BRIGHT = 0.6  # of that level: darker parts are no marrow
MOST = 3.0  # times the marrow before the barrier: what lies behind it and is larger is fat or muscle
NEAR = (
    5,
    5,
    5,
)  # voxels of a stroke around one: the brightest tells the marrow from the edge that it touches
LEAST = 0.85  # of the marrow's level, that a stroke in it shows
NEXT = ndimage.generate_binary_structure(3, 1)


class SureMarks(NamedTuple):
    """Marks of the random walker, and the parts that they leave undecided.

    Attributes
    ----------
    marks : (nx, ny, nz)
        Marks of the walker, 0 where it decides.
    growing : (nx, ny, nz) bool
        Parts behind a barrier that may belong to the bone.
    undecided : float
        Voxels of the largest bright part that neither side's strokes reach clearly better.
    middle : (3,)
        The middle of that part, in voxels.
    """

    marks: NDArray[np.uint8]
    growing: BoolArray
    undecided: float
    middle: Array


def sure_marks(values: NDArray, inside: BoolArray, outside: BoolArray, allowed: BoolArray) -> SureMarks:
    """The strokes, and the voxels that belong to one side's strokes for sure.

    A part behind a barrier that nothing decides stays free if it is small, and is outside if it is much
    larger than the marrow before the barrier.

    Parameters
    ----------
    values : (nx, ny, nz)
        Intensities in units of the bone's marrow level.
    inside, outside : (nx, ny, nz) bool
        Strokes in the bone's marrow, and all others.
    allowed : (nx, ny, nz) bool
        Voxels that are not dark. No path leads through the others.
    """
    strokes = ndimage.grey_dilation(np.where(inside, values, 0), size=NEAR)
    own = flood(values, inside, allowed & ~outside, np.maximum(strokes, LEAST))
    other = flood(values, outside, allowed & ~inside, brighter=True)
    plateau = allowed & (values >= ndimage.maximum_filter(values, footprint=NEXT) - PLATEAU)
    # Fat that is brighter than the strokes around the bone is cheaper for the bone's own strokes, beyond the
    # thinnest place of its shell. A bone does not go on behind the tissue of others.
    zone = parts_with((own < other) | inside, inside)
    sure_inside = plateau & zone & (own < np.minimum(other - CLEAR, FARTHEST))
    sure_outside = plateau & (other < own - CLEAR) & ((other <= DIRECT) | ~np.isfinite(own))
    marks = np.where(outside | sure_outside, OUTSIDE, 0)
    marks = np.where(inside | sure_inside, INSIDE, marks).astype(np.uint8)

    behind = plateau & (marks == 0) & (own > BARRIER) & np.isfinite(own)
    parts, count = ndimage.label(behind)
    sizes = np.bincount(parts.ravel(), minlength=count + 1)
    before = np.count_nonzero((own <= BARRIER) & (own < other))
    large = sizes > MOST * before
    large[0] = False
    marks[large[parts]] = OUTSIDE
    growing = behind & ~large[parts]
    bright, count = ndimage.label(growing & zone & (values > BRIGHT))
    if count == 0:
        return SureMarks(marks, growing, 0.0, np.zeros(3))
    sizes = np.bincount(bright.ravel())
    sizes[0] = 0
    middle = np.argwhere(bright == sizes.argmax()).mean(axis=0)
    return SureMarks(marks, growing, float(sizes.max()), middle)


def parts_with(mask: BoolArray, chosen: BoolArray) -> BoolArray:
    """The connected parts of a mask (nx, ny, nz) that hold a chosen voxel (nx, ny, nz).

    Parameters
    ----------
    mask : (nx, ny, nz) bool
        Voxels whose parts are connected by their faces.
    chosen : (nx, ny, nz) bool
        Voxels that tell which parts count; those outside of the mask tell nothing.

    Returns
    -------
    (nx, ny, nz) bool
    """
    parts, _ = ndimage.label(mask)
    return np.asarray(np.isin(parts, np.setdiff1d(parts[chosen], 0)))
