"""Marks of the random walker where a few strokes leave no doubt.

The walker finds a boundary well between dense marks, and badly far from sparse ones: the probability fades
along a canal and leaks through the many voxels of a blurred boundary. Two minimax floods, from the strokes
in the bone and from all others, tell for most voxels which stroke reaches them with the smaller change of
intensity. Where the difference is clear they become marks; the walker decides the rest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.imaging.minimax_flood import flood
from handpipe.imaging.random_walker import INSIDE, OUTSIDE

CLEAR = 0.15  # of the marrow's level: difference of two floods' costs that decides
FARTHEST = 0.45  # of that level: muscle is about as much darker than marrow
PLATEAU = 0.2  # of that level below the brightest neighbour: darker voxels are part of an edge
NEXT = ndimage.generate_binary_structure(3, 1)


def sure_marks(
    values: NDArray, inside: NDArray[np.bool_], outside: NDArray[np.bool_], allowed: NDArray[np.bool_]
) -> NDArray[np.uint8]:
    """Marks (nx, ny, nz): the strokes, and voxels that belong to one side's strokes for sure; else 0.

    Parameters
    ----------
    values : (nx, ny, nz)
        Intensities in units of the bone's marrow level.
    inside, outside : (nx, ny, nz) bool
        Strokes in the bone's marrow, and all others.
    allowed : (nx, ny, nz) bool
        Voxels that are not dark. No path leads through the others.
    """
    own = flood(values, inside, allowed & ~outside)
    other = flood(values, outside, allowed & ~inside, brighter=True)
    plateau = values >= ndimage.maximum_filter(values, footprint=NEXT) - PLATEAU
    sure_inside = plateau & (own < np.minimum(other - CLEAR, FARTHEST))
    sure_outside = plateau & (other < own - CLEAR)
    marks = np.where(outside | sure_outside, OUTSIDE, 0)
    return np.where(inside | sure_inside, INSIDE, marks).astype(np.uint8)
