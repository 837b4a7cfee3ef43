"""For each voxel of a moved body its place at rest: rigid parts, tetrahedra, surfaces, and smooth gaps."""

from __future__ import annotations

import logging
from enum import IntEnum

import numpy as np

from handpipe.core import Array, BoolArray, IntArray, RigidTransform
from handpipe.imaging.volumes import Volume, box, rasterise
from handpipe.imaging.warping.gaps import fill_gaps
from handpipe.imaging.warping.places import Places
from handpipe.imaging.warping.tet_voxels import interpolate_in_tets
from handpipe.mesh.surfaces import Surface

log = logging.getLogger(__name__)


class Source(IntEnum):
    """What tells where a voxel was at rest."""

    gap = 0
    rigid = 1
    tets = 2
    points = 3


class BackwardField:
    """The displacement back to rest of a moved body's voxels, part by part.

    Parts are added in the order of precedence: a voxel belongs to the first part that covers its centre.

    Parameters
    ----------
    grid : Volume
        Grid of the moved image; its values are not read.
    body : array (nx, ny, nz) of bool
        Voxels of the body; the others have no place at rest.
    """

    def __init__(self, grid: Volume, body: BoolArray) -> None:
        self._grid = grid
        self._slots = np.full(grid.shape, -1, np.int32)
        self._slots[body] = np.arange(int(body.sum()), dtype=np.int32)
        self._voxels: IntArray = np.argwhere(body)
        self._centres = grid.to_world(self._voxels)
        self._free = np.ones(len(self._voxels), bool)
        self._rest = np.zeros_like(self._centres)
        self._source = np.full(len(self._voxels), Source.gap, np.uint8)

    def add_rigid(self, moved: Surface, back: RigidTransform) -> None:
        """The inside of a closed surface in mm, which the transform `back` takes to its place at rest."""
        rows = self._free_rows(moved)
        self._set(rows, back(self._centres[rows]), Source.rigid)

    def add_tets(self, moved: Array, rest: Array, tets: IntArray) -> int:
        """The inside of tets (m, 4) of moved vertices (n, 3) whose places at rest are (n, 3), in mm.

        Inverted and flat tets are left out; their number is returned.
        """
        before = self._free.copy()
        left_out = interpolate_in_tets(
            self._grid.to_index(moved), rest, tets, self._slots, self._free, self._rest
        )
        self._source[before & ~self._free] = Source.tets
        if left_out:
            log.warning("%d of %d tets are inverted or flat: the image is filled there", left_out, len(tets))
        return int(left_out)

    def add_points(self, moved: Array, rest: Array) -> None:
        """The voxels around moved points (n, 3): mean displacement of the points in each, in mm."""
        index = np.rint(self._grid.to_index(moved)).astype(np.int64)
        within = ((index >= 0) & (index < self._grid.shape)).all(axis=1)
        rows = self._slots[tuple(index[within].T)]
        used = rows >= 0
        used[used] = self._free[rows[used]]
        rows, shift = rows[used], (rest - moved)[within][used]
        count = np.bincount(rows, minlength=len(self._free))
        sums = [np.bincount(rows, shift[:, c], len(self._free)) for c in range(3)]
        hit = np.flatnonzero(count)
        back = np.stack(sums, axis=1)[hit] / count[hit, None]
        self._set(hit, self._centres[hit] + back, Source.points)

    def reserve(self, moved: Surface) -> None:
        """Leave the free voxels inside of a closed surface to `filled`: no later part tells their places."""
        self._free[self._free_rows(moved)] = False

    def filled(self) -> Places:
        """The places of all voxels: the displacement of those that no part tells is harmonic.

        Returns
        -------
        Places
            Of every voxel of the body.

        Raises
        ------
        ConvergenceError
            If the harmonic displacement is not found.
        """
        known = self._source != Source.gap
        shift = fill_gaps(self._rest - self._centres, known, self._slots, self._grid.spacing)
        rest = np.where(known[:, None], self._rest, self._centres + shift)
        return Places(self._grid.shape, self._grid.affine, self._voxels, rest, self._source.copy())

    def _free_rows(self, surface: Surface) -> IntArray:
        """Rows of the free voxels inside of a surface."""
        index = self._grid.to_index(surface.vertices)
        lower = np.clip(np.floor(index.min(axis=0)).astype(np.int64), 0, self._grid.shape)
        upper = np.clip(np.ceil(index.max(axis=0)).astype(np.int64) + 1, lower, self._grid.shape)
        if (upper == lower).any():
            return np.zeros(0, np.int64)
        part = self._grid.crop(lower, upper)
        block = self._slots[box(lower, upper)]
        rows = block[rasterise(part, {1: surface}) > 0].astype(np.int64)
        rows = rows[rows >= 0]
        return rows[self._free[rows]]

    def _set(self, rows: IntArray, rest: Array, source: Source) -> None:
        self._rest[rows] = rest
        self._source[rows] = source
        self._free[rows] = False
