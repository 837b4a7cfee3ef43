"""How alike two images are where both show a body."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from handpipe.core import Array, BoolArray

FLAT = 1e-3  # least deviation in a window, as a share of the whole image's, to tell a pattern from noise
LEAST = 0.25  # of a window that has to be in the body


def correlation(a: Array, b: Array) -> float:
    """Normalised cross-correlation of two images: 1 where one is a rising linear function of the other.

    Parameters
    ----------
    a, b : array (k,)
        Intensities at the same places.

    Returns
    -------
    float
        From -1 to 1; 0 where an image is constant or empty.
    """
    if len(a) == 0:
        return 0.0
    u, v = a - a.mean(), b - b.mean()
    size = float(np.sqrt((u @ u) * (v @ v)))
    return float(u @ v) / size if size > 0 else 0.0


def local_correlation(a: Array, b: Array, body: BoolArray, width: Array) -> float:
    """Mean of the normalised cross-correlations in windows around each voxel of a body.

    A field of brightness that varies slowly, as of a receive coil, hardly changes it.

    Parameters
    ----------
    a, b : array (nx, ny, nz)
        Images on one grid; read inside of the body alone.
    body : array (nx, ny, nz) of bool
        Voxels of the body.
    width : array (3,)
        Width of the windows in voxels along each axis.

    Returns
    -------
    float
        From -1 to 1, over windows with a pattern in both images and a quarter of their voxels in the body; 0
        where there is none.
    """
    sizes = np.maximum(np.rint(width), 1).astype(int)

    def mean(values: Array) -> Array:
        return np.asarray(ndimage.uniform_filter(np.where(body, values, 0.0), sizes, mode="constant"))

    share = mean(np.ones(body.shape))
    whole = np.maximum(share, LEAST)
    a, b = (np.where(body, v - v[body].mean(), 0.0) if body.any() else v for v in (a, b))
    mean_a, mean_b = mean(a) / whole, mean(b) / whole
    variance_a, variance_b = mean(a * a) / whole - mean_a**2, mean(b * b) / whole - mean_b**2
    used = body & (share >= LEAST)
    used &= (variance_a > FLAT**2 * _variance(a, body)) & (variance_b > FLAT**2 * _variance(b, body))
    if not used.any():
        return 0.0
    common = mean(a * b) / whole - mean_a * mean_b
    return float((common[used] / np.sqrt(variance_a[used] * variance_b[used])).mean())


def _variance(values: Array, body: BoolArray) -> float:
    return float(values[body].var()) if body.any() else 0.0
