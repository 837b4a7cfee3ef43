"""Marks of the random walker by distance: which strokes are nearer along the image.

A limb's marrow and its fat are equally bright, and between them lies a shell of half a voxel: a path as cheap
as any within the marrow leads from one into the other, and minimax floods (`sure_marks`) find it. A distance
counts the way, too. Edges and dark layers lengthen it: each stroke takes what lies before the next edge, and
what comes through a hole in a shell arrives late (geodesic distances: Criminisi 2008, Sec. 3).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.graph import MCP_Geometric

from handpipe.core import Array, BoolArray
from handpipe.imaging.segmentation.random_walker import INSIDE, OUTSIDE

BLUR = 0.5  # voxels
BRIGHTEST = 1.3  # of the marrow's level: bright fat has no edges of its own
LENGTHENED = 40.0  # times a way of a voxel, by an edge of the marrow's whole level
NOISE = (0.05, 0.1)  # of the marrow's level: slope and depth of a valley within one tissue
VALLEY = 2.0  # a valley of a voxel has no slope at its bottom, and counts as both its sides
CLEAR = 0.5  # times the other distance: nearer leaves no doubt
BRIGHT = 0.55  # of the marrow's level: darker voxels are left to the walker


def distance_marks(
    values: NDArray, inside: BoolArray, outside: BoolArray, dark: BoolArray, spacing: Array
) -> NDArray[np.uint8]:
    """The strokes, and the voxels that are much nearer to one side's strokes than to the other's.

    Parameters
    ----------
    values : (nx, ny, nz)
        Intensities in units of the bone's marrow level.
    inside, outside : (nx, ny, nz) bool
        Strokes in the bone's marrow, and all others.
    dark : (nx, ny, nz) bool
        Voxels that are too dark for marrow.
    spacing : (3,)
        Of the voxels in mm.
    """
    way = lengthening(values)
    own, other = (_distance(way, strokes, spacing) for strokes in (inside, outside))
    marks = np.where(dark | (other < CLEAR * own), OUTSIDE, 0)
    marks = np.where((own < CLEAR * other) & (values > BRIGHT), INSIDE, marks)
    return np.where(outside, OUTSIDE, np.where(inside & ~dark, INSIDE, marks)).astype(np.uint8)


def lengthening(values: NDArray) -> Array:
    """How much longer than in space a way through each voxel is; values in units of the marrow's level."""
    smooth = ndimage.gaussian_filter(np.minimum(values, BRIGHTEST).astype(float), BLUR)
    slope = np.sqrt(sum(ndimage.convolve1d(smooth, [0.5, 0.0, -0.5], axis=a) ** 2 for a in range(3)))
    valley = ndimage.grey_closing(smooth, size=(3, 3, 3)) - smooth
    edges = np.maximum(slope - NOISE[0], 0) + VALLEY * np.maximum(valley - NOISE[1], 0)
    return np.asarray(1 + LENGTHENED * edges)


def _distance(way: Array, strokes: BoolArray, spacing: Array) -> Array:
    """Length (nx, ny, nz) in mm of the shortest way to the strokes; infinite without strokes."""
    sources = np.argwhere(strokes)
    if len(sources) == 0:
        return np.full(way.shape, np.inf)
    found, _ = MCP_Geometric(way, sampling=tuple(spacing)).find_costs(sources)
    return np.asarray(found)
