"""The length with which a solver compares its steps."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array


def spacing(x: Array) -> float:
    """Mean distance in mm of vertices (n, 3) from their neighbours, by the volume of their box."""
    extent = np.ptp(x, axis=0)
    extent = np.maximum(extent, 1e-3 * extent.max())
    return float((extent.prod() / len(x)) ** (1 / 3))
