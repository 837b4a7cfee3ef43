"""From where a hand is seen: directions of its bones and joints, not of axes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import Array, Frame, Shapes
from handpipe.evaluation.moved_images import anatomical_planes
from handpipe.skeleton.rig import Rig


def anatomical_axes(rig: Rig, frame: Frame, layers: Mapping[str, Shapes], hand: str) -> dict[str, Array]:
    """Directions of a posed hand, those of its middle metacarpal.

    Parameters
    ----------
    rig : Rig
        Joints of the subject.
    frame : Frame
        The frame, with the bones' transforms.
    layers : mapping of str to Shapes
        Its shapes by layer and body.
    hand : {"right", "left"}
        The dataset's field.

    Returns
    -------
    dict of str to array (3,)
        Unit vectors "distal", "palm", "back", "radial", "ulnar". Those of a body with less than two bones are
        the phantoms': distal +x, back +z.
    """
    coronal = anatomical_planes(rig, frame, layers).get("coronal") if "bones" in layers else None
    distal, flexion = (np.eye(3)[0], np.eye(3)[1]) if coronal is None else (coronal.right, coronal.up)
    radial = flexion if hand == "right" else -flexion
    palm = np.cross(flexion, distal)  # positive flexion moves distal bones towards the palm
    return {"distal": distal, "palm": palm, "back": -palm, "radial": radial, "ulnar": -radial}


def seen_from(axes: Mapping[str, Array], side: str) -> tuple[Array, Array]:
    """Directions in which a camera looks and that points upwards in its picture.

    Parameters
    ----------
    axes : mapping of str to array (3,)
        Directions of `anatomical_axes`.
    side : {"palm", "back", "radial", "ulnar"}
        Where the camera stands; the thumb is on the radial side.

    Returns
    -------
    direction, up : array (3,)
        As `Camera` takes them: distal upwards, from the radial or the ulnar side dorsal.
    """
    return -axes[side], axes["distal" if side in ("palm", "back") else "back"]
