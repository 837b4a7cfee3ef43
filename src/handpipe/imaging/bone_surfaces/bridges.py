"""Bridges between parts of one bone's marrow that the shaft's cortex separates at the voxel size.

Each smaller part gets a thin bridge to the largest one along the brightest way. The bone's surfaces are then
in one piece; the bridge's own volume is that of a canal of one voxel's radius.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.graph import MCP_Geometric

FEWEST = 8  # voxels: smaller parts are noise
DARKNESS = 4.0  # times a bright voxel's length that a dark one counts
INSIDE = 0.01  # cost of a voxel that is claimed
FADING = 0.4  # of probability, by a voxel's distance from a bridge


def bridged(probability: NDArray, values: NDArray) -> NDArray[np.float32]:
    """Probability of marrow in which all claimed parts of a bone are connected.

    Parameters
    ----------
    probability : array (nx, ny, nz)
        Probability of the bone's marrow; above 0.5 it claims a voxel.
    values : array (nx, ny, nz)
        Intensities of the same voxels.

    Returns
    -------
    array (nx, ny, nz) of float32
        Probability with bridges between parts of at least `FEWEST` voxels.
    """
    parts, count = ndimage.label(probability > 0.5)
    sizes = np.bincount(parts.ravel())[1:]
    if count < 2 or (sizes >= FEWEST).sum() < 2:
        return np.asarray(probability, np.float32)
    main = int(np.argmax(sizes)) + 1
    level = float(np.median(values[parts == main]))
    costs = 1 + DARKNESS * np.clip(1 - values / level, 0, 1)
    costs[parts > 0] = INSIDE
    search = MCP_Geometric(costs)
    lengths, _ = search.find_costs(np.argwhere(parts == main))
    line = np.zeros(probability.shape, bool)
    for part in np.flatnonzero(sizes >= FEWEST) + 1:
        if part != main:
            ends = np.argwhere(parts == part)
            nearest = ends[np.argmin(lengths[tuple(ends.T)])]
            line[tuple(np.array(search.traceback(nearest)).T)] = True
    distance = ndimage.distance_transform_edt(~line)
    return np.maximum(probability, np.clip(1 - FADING * distance, 0, 1)).astype(np.float32)
