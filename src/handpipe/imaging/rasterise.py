"""Closed surfaces as labels of voxels."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from handpipe.imaging.volume import Volume, box
from handpipe.mesh.distance import Distance
from handpipe.mesh.surface import Surface


def rasterise(volume: Volume, surfaces: Mapping[int, Surface]) -> NDArray[np.uint8]:
    """Labels (nx, ny, nz) of the voxels with centres inside closed surfaces; the last wins an overlap."""
    labels = np.zeros(volume.shape, np.uint8)
    for label, surface in surfaces.items():
        corners = volume.to_index(surface.vertices)
        lower = np.clip(np.floor(corners.min(0)).astype(np.int64), 0, volume.shape)
        upper = np.clip(np.ceil(corners.max(0)).astype(np.int64) + 1, 0, volume.shape)
        local = np.indices(upper - lower).reshape(3, -1).T + lower
        inside = Distance(surface).signed(volume.to_world(local))[0] < 0
        labels[box(lower, upper)][inside.reshape(upper - lower)] = label
    return labels
