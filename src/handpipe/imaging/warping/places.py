"""Where the voxels of a moved body were at rest, and an image taken along."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array, BoolArray, IntArray
from handpipe.imaging.volumes import Volume


@dataclass(frozen=True, eq=False)
class Places:
    """Where the voxels of a moved body were at rest.

    Parameters
    ----------
    shape : tuple of three int
        Number of voxels of the moved grid along each axis.
    affine : array (4, 4)
        From its voxel indices to world mm.
    voxels : array (k, 3) of int
        Voxels of the body.
    rest : array (k, 3)
        Their centres' places at rest, world mm.
    source : array (k,) of uint8
        What tells each place, a `Source`.
    """

    shape: tuple[int, int, int]
    affine: Array
    voxels: IntArray
    rest: Array
    source: NDArray[np.uint8]

    def imaged(self, image: Volume) -> BoolArray:
        """Which voxels (k,) of the body were inside of an image at rest."""
        index = image.to_index(self.rest)
        within = (index > -0.5) & (index < np.array(image.shape) - 0.5)
        return np.asarray(within.all(axis=1), dtype=np.bool_)

    def values(self, image: Volume) -> Array:
        """What an image at rest shows at each voxel (k,) of the body; 0 beyond the image."""
        return np.where(self.imaged(image), image.sample(self.rest), 0.0)

    def on_grid(self, values: Array) -> Volume:
        """A volume on the moved grid with values (k,) in the body and 0 around it."""
        grid = np.zeros(self.shape, np.float32)
        grid[tuple(self.voxels.T)] = values
        return Volume(grid, self.affine)

    def at(self, image: Volume) -> Array:
        """What an image on the moved grid itself shows at each voxel (k,) of the body."""
        return np.asarray(image.values[tuple(self.voxels.T)], dtype=np.float64)
