"""What a motion has beyond turns about hinted axes, when a person's hints may be off."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joints import leftover

OFF = np.radians(30.0)  # by which a hint may be off
DIRECTIONS, STEPS = 24, 3  # of the tilts that are tried


def tilted_axes(axes: Axes) -> list[Axes]:
    """The hinted axes, and all of them tilted together by up to `OFF` in many directions."""
    return [Axes(axes.directions @ tilt.T, axes.order) for tilt in _TILTS]


def beyond_hints(axes: Axes, rotation: Array) -> float:
    """Angle in rad of a rotation (3, 3) that no turns about axes within `OFF` of the hinted ones explain."""
    return min(float(np.linalg.norm(leftover(a, rotation[None]))) for a in tilted_axes(axes))


def _tilts() -> Array:
    """Rotations (1 + DIRECTIONS * STEPS, 3, 3) up to `OFF`, about axes spread evenly over the sphere."""
    index = np.arange(DIRECTIONS) + 0.5
    height, turn = 1 - 2 * index / DIRECTIONS, np.pi * (1 + np.sqrt(5)) * index
    across = np.sqrt(1 - height**2)
    about = np.column_stack([across * np.cos(turn), across * np.sin(turn), height])
    sizes = OFF * np.arange(1, STEPS + 1) / STEPS
    vectors = np.vstack([np.zeros((1, 3)), *(size * about for size in sizes)])
    return np.asarray(Rotation.from_rotvec(vectors).as_matrix(), float)


_TILTS = _tilts()
