"""Where an image may show marrow: bright as the brightest tissue nearby, with something dark close outside.

Intensities are taken in units of a local level, so that a bias field and the scanner's gain drop out. Two
coarse images forgive misplacements of about a millimetre and a half: a search over large motions needs few
trials in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import block_reduce

from handpipe.core import IntArray
from handpipe.imaging.volumes.volume import Volume

LEVEL_GRID = 2.0  # mm, of the field of levels
LEVEL_REACH = 8.0  # mm within which some marrow or fat lies, wherever there is a bone
COARSE_GRID = 1.0  # mm
EVEN_LEVEL = 0.85  # quantile of tissue, brighter than the mean of tissue and air, that marrow has
FLOOR = 0.5  # of the usual level: the least local level, so that the noise of air stays small
BRIGHTEST = 1.3  # levels; brighter values, of vessels and artefacts, add no evidence
USUAL = 0.98  # quantile of the image that is the usual level


@dataclass(frozen=True)
class MarrowEvidence:
    """A pose's image in units of the local marrow level, fine and coarse.

    Beyond the grid nothing is known.

    Parameters
    ----------
    fine : Volume
        Image at the resolution of the scan.
    bright : Volume
        Means over blocks of about `COARSE_GRID` mm.
    dark : Volume
        Lowest value within a voxel or two of the coarse grid.
    """

    fine: Volume
    bright: Volume
    dark: Volume

    @staticmethod
    def measure(volume: Volume, even: bool = False) -> MarrowEvidence:
        """From a volume in which marrow and fat are the brightest tissues.

        even: marrow has one level everywhere, since the volume has no shading. Beside skin fat brighter than
        marrow the local level is the fat's.
        """
        fine = volume.like(_by_one_level(volume) if even else normalised(volume))
        steps = np.maximum(np.round(COARSE_GRID / volume.spacing), 1).astype(int)
        bright, darkest = (blocks(fine, steps, f) for f in (np.mean, np.min))
        return MarrowEvidence(fine, bright, darkest.like(ndimage.minimum_filter(darkest.values, 3)))


def blocks(volume: Volume, steps: IntArray, reduction: object) -> Volume:
    """One voxel for each block of steps (3,) voxels; what does not fill a block at the end is left out."""
    whole = [slice(0, max(n // s, 1) * s) for n, s in zip(volume.shape, steps, strict=True)]
    values = block_reduce(volume.values[tuple(whole)], tuple(int(s) for s in steps), reduction)
    affine = volume.affine.copy()
    affine[:3, 3] = volume.to_world((steps - 1)[None] / 2)[0]
    affine[:3, :3] = affine[:3, :3] * steps
    return Volume(np.ascontiguousarray(values, dtype=np.float32), affine)


def normalised(volume: Volume) -> NDArray[np.float32]:
    """Values (nx, ny, nz) by the level of the brightest tissue within a few mm, at most `BRIGHTEST`."""
    steps = np.maximum(np.round(LEVEL_GRID / volume.spacing), 1).astype(int)
    coarse = blocks(volume, steps, np.mean)
    reach = np.maximum(np.round(LEVEL_REACH / coarse.spacing), 1)
    highest = ndimage.maximum_filter(coarse.values, size=[int(2 * r + 1) for r in reach])
    level = ndimage.gaussian_filter(highest, reach / 2)
    usual = float(np.quantile(coarse.values, USUAL))
    level = np.maximum(level, FLOOR * usual).astype(np.float32)
    return _divided(volume.values, level, steps.astype(np.float64), np.float32(BRIGHTEST))


def _by_one_level(volume: Volume) -> NDArray[np.float32]:
    """Values (nx, ny, nz) by a level of bright tissue in the whole volume, at most `BRIGHTEST`."""
    tissue = volume.values[volume.values > volume.values.mean()]
    level = np.float32(max(float(np.quantile(tissue, EVEN_LEVEL)), 1e-12))
    return np.minimum(volume.values / level, np.float32(BRIGHTEST))


@njit(cache=True)
def _divided(values, level, steps, highest):  # type: ignore[no-untyped-def]
    """Values by a coarse level, linear between the middles of blocks of steps (3,) voxels."""
    shape, coarse = values.shape, level.shape
    out = np.empty(shape, np.float32)
    last = max(shape)
    base = np.zeros((3, last), np.int64)
    share = np.zeros((3, last), np.float32)
    for c in range(3):
        for i in range(shape[c]):
            x = min(max((i - (steps[c] - 1) / 2) / steps[c], 0.0), coarse[c] - 1.0)
            base[c, i] = min(int(x), max(coarse[c] - 2, 0))
            share[c, i] = x - base[c, i]
    for i in range(shape[0]):
        a, u = base[0, i], share[0, i]
        a1 = min(a + 1, coarse[0] - 1)
        for j in range(shape[1]):
            b, v = base[1, j], share[1, j]
            b1 = min(b + 1, coarse[1] - 1)
            for k in range(shape[2]):
                d, w = base[2, k], share[2, k]
                d1 = min(d + 1, coarse[2] - 1)
                low = (1 - u) * ((1 - v) * level[a, b, d] + v * level[a, b1, d])
                low += u * ((1 - v) * level[a1, b, d] + v * level[a1, b1, d])
                high = (1 - u) * ((1 - v) * level[a, b, d1] + v * level[a, b1, d1])
                high += u * ((1 - v) * level[a1, b, d1] + v * level[a1, b1, d1])
                out[i, j, k] = min(values[i, j, k] / ((1 - w) * low + w * high), highest)
    return out
