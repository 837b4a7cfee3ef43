"""The length with which a solver compares its steps."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array

FLAT = 1e-3  # of the longest extent, which the others have at least


def spacing(x: Array) -> float:
    """Mean distance in mm of vertices (n, 3) from their neighbours, by the volume of their box."""
    extent = np.ptp(x, axis=0)
    extent = np.maximum(extent, FLAT * extent.max())
    return float((extent.prod() / len(x)) ** (1 / 3))
