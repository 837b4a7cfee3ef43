"""From where a hand is seen, by anatomical names."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import numpy as np

from handpipe.core import Array, Frame
from handpipe.skeleton.rig import HandDirections, Rig, hand_directions

AXES = HandDirections(np.eye(3)[0], np.eye(3)[2], np.eye(3)[1], "")  # of a subject whose joints tell none
# Name of the view: the side on which the camera is, and what points upwards.
VIEWS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "palm": ("palmar", "distal"),
        "back": ("dorsal", "distal"),
        "thumb": ("radial", "distal"),
        "little finger": ("ulnar", "distal"),
        "fingertips": ("distal", "dorsal"),
    }
)


def view_directions(directions: HandDirections) -> dict[str, tuple[Array, Array]]:
    """Where the camera is and what points upwards in each of `VIEWS`.

    Parameters
    ----------
    directions : HandDirections
        Directions of the hand.

    Returns
    -------
    dict of str to tuple of array (3,)
        Unit vectors by view: from the hand to the camera, and upwards.
    """
    sides = {
        "distal": directions.distal,
        "dorsal": directions.dorsal,
        "palmar": -directions.dorsal,
        "radial": directions.radial,
        "ulnar": -directions.radial,
    }
    return {view: (sides[camera], sides[up]) for view, (camera, up) in VIEWS.items()}


def camera_views(rig: Rig, frame: Frame, hand: Literal["right", "left"]) -> dict[str, tuple[Array, Array]]:
    """Directions of sight and upwards in each of `VIEWS`, as `Camera` takes them.

    Parameters
    ----------
    rig : Rig
        Joints of the subject. Where none of them moves, x is distal, y radial and z dorsal.
    frame : Frame
        The frame, with the bones' transforms.
    hand : str
        "right" or "left".

    Returns
    -------
    dict of str to tuple of array (3,)
        Unit vectors by view: from the camera to the hand, and upwards.
    """
    directions = (hand_directions(rig, hand) or AXES).moved(frame.bones)
    return {view: (-side, up) for view, (side, up) in view_directions(directions).items()}
