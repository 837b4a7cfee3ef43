"""How far the intensity has to depart from a mark's on the way from the mark to a voxel (a minimax path).

The random walker weighs lengths and widths: along a narrow canal the probability of a short stroke fades, and
at a beta of 100 the many faint edges of a blurred boundary outweigh it. The minimax path knows neither length
nor width. Its cost is the greatest departure on the best path, as in the image foresting transform (Falcao
2004) and in the limit of the walker for an infinite exponent (Couprie 2011). One frontier in order of cost
visits each voxel once.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handpipe.core import BoolArray

STEPS = 250  # costs between 0 and `HIGHEST`
HIGHEST = 1.25  # in units of the values: what costs more is not reached


def flood(
    values: NDArray,
    sources: BoolArray,
    allowed: BoolArray,
    references: NDArray | None = None,
    brighter: bool = False,
) -> NDArray[np.float32]:
    """Cost (nx, ny, nz) of the best path from any source to each voxel; infinite where none leads.

    Parameters
    ----------
    values : (nx, ny, nz)
        Intensities in units of a tissue's level.
    sources, allowed : (nx, ny, nz) bool
        Where paths start, and where they may go.
    references : (nx, ny, nz)
        Intensity at sources from which departures count; by default that of the source itself.
    brighter : bool
        Whether brighter voxels than the source cost as much as darker ones; else they are free.

    Returns
    -------
    Costs in the units of `values`, rounded down to `HIGHEST` / `STEPS`.
    """
    steps = _flood(
        np.pad(np.asarray(values, np.float32), 1),
        np.pad(np.asarray(values if references is None else references, np.float32), 1),
        np.pad(sources, 1),
        np.pad(allowed | sources, 1),
        np.float32(STEPS / HIGHEST),
        brighter,
    )[1:-1, 1:-1, 1:-1]
    return np.where(steps <= STEPS, steps * np.float32(HIGHEST / STEPS), np.float32(np.inf))


@njit(cache=True)
def _flood(values, references, sources, allowed, scale, brighter):  # type: ignore[no-untyped-def]
    """Costs in whole steps, by Dial's buckets; more than `STEPS` where a voxel is not reached."""
    shape = values.shape
    stride = (shape[1] * shape[2], shape[2], 1)
    v, levels, free = values.ravel(), references.ravel(), allowed.ravel()
    cost = np.full(v.size, STEPS + 1, np.int16)
    root = np.zeros(v.size, np.float32)
    after = np.full(v.size, -1, np.int32)
    before = np.full(v.size, -1, np.int32)
    head = np.full(STEPS + 1, -1, np.int32)
    for i in np.flatnonzero(sources.ravel()):
        cost[i], root[i] = 0, levels[i]
        after[i] = head[0]
        if head[0] >= 0:
            before[head[0]] = i
        head[0] = i
    for c in range(STEPS + 1):
        while head[c] >= 0:
            i = head[c]
            head[c] = after[i]
            if head[c] >= 0:
                before[head[c]] = -1
            free[i] = False
            for axis in range(3):
                for j in (i - stride[axis], i + stride[axis]):
                    if not free[j]:
                        continue
                    off = root[i] - v[j]
                    if off < 0:
                        off = -off if brighter else np.float32(0)
                    new = max(c, int(off * scale))
                    if new >= cost[j]:
                        continue
                    if cost[j] <= STEPS:
                        if before[j] >= 0:
                            after[before[j]] = after[j]
                        else:
                            head[cost[j]] = after[j]
                        if after[j] >= 0:
                            before[after[j]] = before[j]
                    cost[j], root[j] = new, root[i]
                    before[j], after[j] = -1, head[new]
                    if head[new] >= 0:
                        before[head[new]] = j
                    head[new] = j
    return cost.reshape(shape)
