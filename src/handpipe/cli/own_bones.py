"""Bones and joints by the names that a person gives, where the template hand does not have them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from handpipe.core import InputError

JOINT = re.compile(r"([A-Za-z]\w*)-([A-Za-z]\w*)(:fixed)?", re.ASCII)
AXES = "xyz"  # of the neutral image: a ball joint fits every rotation about any three of them
LIMIT = 45.0  # deg, either way about each axis: a wider search takes longer


def own_bones(joints: Sequence[str]) -> dict[str, Any]:
    """Fields of a dataset for joints of a person's own names: ball joints, or bones that move as one.

    Parameters
    ----------
    joints : sequence of str
        Each as PARENT-CHILD for a ball joint, or PARENT-CHILD:fixed.

    Returns
    -------
    dict
        `bones` in the order in which the joints name them, without templates, and `joints`.

    Raises
    ------
    InputError
        For a joint that is written otherwise, joins a bone to itself, or is named twice.
    """
    bones: dict[str, Any] = {}
    found: dict[str, Any] = {}
    for text in joints:
        match = JOINT.fullmatch(text)
        if match is None:
            remedy = (
                "Give PARENT-CHILD, as radius-lunate, or PARENT-CHILD:fixed; names are letters and digits"
            )
            raise InputError("--joint", text, "names no two bones", remedy)
        parent, child, fixed = match.groups()
        if parent == child:
            raise InputError("--joint", text, "joins a bone to itself", "Name two bones")
        if f"{parent}_{child}" in found:
            raise InputError(
                "--joint", text, "is named twice", "Give each joint once, as a ball joint or as fixed"
            )
        for bone in (parent, child):
            bones.setdefault(bone, {"label": len(bones) + 1})
        axes = [] if fixed else np.eye(3, dtype=int).tolist()
        found[f"{parent}_{child}"] = {
            "parent": parent,
            "child": child,
            "angles": [f"{parent}_{child}_{axis}" for axis in AXES[: len(axes)]],
            "limits_deg": [[-LIMIT, LIMIT] for _ in axes],
            "axis_hints": axes,
        }
    return {"bones": bones, "joints": found}
