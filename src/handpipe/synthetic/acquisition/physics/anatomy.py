"""What is imaged: tissues in paint order, with the bones' surfaces and the palm's direction."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from numpy.typing import NDArray

from handpipe.core import Array, IntArray

Layer = tuple[str, NDArray]
"""A tissue's name and its share (nx, ny, nz) of each voxel, which it takes from the layers before it."""


@dataclass(frozen=True)
class ImagedAnatomy:
    """A posed subject as the image model takes it.

    Parameters
    ----------
    layers : iterable of (str, array (nx, ny, nz))
        Tissues in paint order with their shares of each voxel; the first one fills the skin.
    bones : sequence of (array (n, 3), array (k, 3))
        Closed surfaces of the whole bones in mm, with the same vertices in every pose.
    palm : array (3,)
        Direction from the back of the hand to its palm.
    """

    layers: Iterable[Layer]
    bones: Sequence[tuple[Array, IntArray]]
    palm: Array
