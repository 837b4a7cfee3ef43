"""From where a hand is seen, by anatomical names."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from handpipe.core import Array
from handpipe.skeleton.rig import HandDirections

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
