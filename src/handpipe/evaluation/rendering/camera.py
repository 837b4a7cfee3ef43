"""Where a picture is taken from, and what is cut away before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array

MARGIN = 1.06  # height of a picture over the least one that shows everything


@dataclass(frozen=True)
class Camera:
    """Parallel projection.

    Parameters
    ----------
    centre : array (3,)
        Point in mm in the middle of the picture.
    direction : array (3,)
        Direction in which the camera looks.
    up : array (3,)
        Direction that points upwards in the picture as far as `direction` allows.
    height : float
        Height in mm of the picture.
    """

    centre: Array
    direction: Array
    up: Array
    height: float

    @staticmethod
    def fit(
        points: Array | Sequence[Array],
        direction: Array,
        up: Array,
        size: tuple[int, int],
        margin: float = MARGIN,
    ) -> Camera:
        """The smallest camera that sees all points.

        Parameters
        ----------
        points : array (n, 3) or sequence of them
            Points in mm to be seen.
        direction, up : array (3,)
            As in `Camera`.
        size : tuple of int
            Width and height of the picture in pixels.
        margin : float
            Height of the picture over the least height.

        Returns
        -------
        Camera
            Its centre is that of the points' extent.
        """
        axes = _axes(np.asarray(direction, float), np.asarray(up, float))
        seen = (points if isinstance(points, np.ndarray) else np.concatenate(points)) @ axes.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        width, height, _ = high - low
        height = margin * max(height, width * size[1] / size[0])
        return Camera(0.5 * (low + high) @ axes, axes[2], axes[1], height)

    @property
    def axes(self) -> Array:
        """Rows right, up, forward (3, 3)."""
        return _axes(self.direction, self.up)


@dataclass(frozen=True)
class Cut:
    """Removes what lies on one side of a plane; closed opaque bodies are capped with their flat colour.

    Parameters
    ----------
    point : array (3,)
        Point in mm on the plane.
    normal : array (3,)
        Normal of the plane, which points to the removed side.
    """

    point: Array
    normal: Array


def _axes(direction: Array, up: Array) -> Array:
    forward = direction / np.linalg.norm(direction)
    right = np.cross(forward, up)
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])
