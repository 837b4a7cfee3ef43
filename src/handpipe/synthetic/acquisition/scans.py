"""A skin scan: another sampling of the skin, open at the cut end, with a few holes and a little noise."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array, IntArray


def scan(
    neutral: Array,
    posed: Array,
    triangles: IntArray,
    rng: np.random.Generator,
    *,
    open_before: float,
    noise: float = 0.03,
    holes: int = 4,
) -> tuple[Array, IntArray]:
    """Scan of a posed surface (n, 3) without all of neutral x below `open_before` and `holes` discs.

    Returns vertices with Gaussian `noise` mm along each axis, and the remaining triangles.
    """
    keep = neutral[triangles].mean(axis=1)[:, 0] > open_before
    centres = posed[triangles].mean(axis=1)
    for index in rng.choice(np.flatnonzero(keep), holes, replace=False):
        keep &= np.linalg.norm(centres - centres[index], axis=1) > rng.uniform(1.5, 3.5)
    used, renumbered = np.unique(triangles[keep], return_inverse=True)
    vertices = posed[used] + noise * rng.standard_normal((len(used), 3))
    return vertices, renumbered.reshape(-1, 3).astype(np.int64)
