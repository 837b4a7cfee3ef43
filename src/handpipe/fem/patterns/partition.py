"""Shares of a mesh for threads: each owns vertices, and with them rows that no other thread writes to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from handpipe.core import Array, Int32Array, IntArray


class PartitionArrays(NamedTuple):
    """Arrays of a partition, for compiled loops.

    owner (n,): the part of each vertex; part p has vertices[vertex_starts[p]:vertex_starts[p + 1]], and the
    cells with one of these are cells[cell_starts[p]:cell_starts[p + 1]], ascending.
    """

    owner: Int32Array
    vertices: IntArray
    vertex_starts: IntArray
    cells: IntArray
    cell_starts: IntArray


@dataclass(frozen=True)
class Partition:
    """Who owns which vertices, and which cells touch them.

    A cell on a border is visited by each of its owners, who keep their own rows of it alone. Sums run over
    ascending cells whatever the number of parts, so that results agree to the last bit.
    """

    share: PartitionArrays

    @property
    def parts(self) -> int:
        """Number of parts."""
        return len(self.share.vertex_starts) - 1

    @staticmethod
    def of_cells(cells: IntArray, points: Array, parts: int) -> Partition:
        """Parts of equal work, by bisection across the longest side of the points (n, 3) of cells (m, k)."""
        owner = np.zeros(len(points), dtype=np.int32)
        if parts > 1:
            loads = np.bincount(cells.ravel(), minlength=len(points)).astype(float)
            _bisect(points, loads, np.arange(len(points)), 0, parts, owner)
        visited = [np.flatnonzero((owner[cells] == p).any(axis=1)) for p in range(parts)]
        owned = np.bincount(owner, minlength=parts)
        share = PartitionArrays(
            owner,
            np.argsort(owner, kind="stable"),
            np.concatenate([[0], np.cumsum(owned)]),
            np.concatenate(visited),
            np.concatenate([[0], np.cumsum([len(v) for v in visited])]),
        )
        return Partition(share)


def _bisect(
    points: Array, loads: Array, members: IntArray, first: int, parts: int, owner: Int32Array
) -> None:
    owner[members] = first
    if parts == 1 or len(members) < 2:
        return
    along = points[members, np.argmax(np.ptp(points[members], axis=0))]
    members = members[np.argsort(along, kind="stable")]
    left = parts // 2
    work = np.cumsum(loads[members])
    cut = int(np.searchsorted(work, work[-1] * left / parts))
    _bisect(points, loads, members[:cut], first, left, owner)
    _bisect(points, loads, members[cut:], first + left, parts - left, owner)


def spatial_order(points: Array) -> IntArray:
    """Order (n,) along a Morton curve through points (n, 3): points near in space are near in the order."""
    low, size = points.min(axis=0), np.ptp(points, axis=0).max()
    cells = ((points - low) * (1023 / max(size, 1e-300))).astype(np.uint32)
    code = np.zeros(len(points), dtype=np.uint32)
    for axis in range(3):
        bits = cells[:, axis]
        for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
            bits = (bits | (bits << np.uint32(shift))) & np.uint32(mask)
        code |= bits << np.uint32(axis)
    return np.argsort(code, kind="stable")
