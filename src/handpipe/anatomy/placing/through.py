"""A click through the skin: the middle between where its ray enters and leaves (Abdrashitov 2021 §3.1.1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handpipe.anatomy.templates.curves import ray_hits
from handpipe.core import Array, InputError
from handpipe.mesh.surfaces import Surface


def middle_inside(skin: Surface, origin: Array, direction: Array, source: str | Path) -> Array:
    """Point halfway between the places where a ray enters a skin for the first time and leaves it.

    Parameters
    ----------
    skin : Surface
        Closed surface in mm, whose triangles face outwards.
    origin : array (3,)
        Eye in mm.
    direction : array (3,)
        Direction of the ray; any length but zero.
    source : path
        The file, for messages.

    Returns
    -------
    array (3,)
        Point in mm.

    Raises
    ------
    InputError
        Where the ray does not pass through the skin.
    """
    length = float(np.linalg.norm(direction))
    if not (np.isfinite([*origin, *direction]).all() and length > 0):
        raise InputError(source, "click", "has no direction", "Load the page again")
    direction = direction / length
    triangles, along = ray_hits(skin, origin, direction)
    leaves = skin.triangle_normals()[triangles] @ direction > 0
    enter = along[~leaves].min(initial=np.inf)
    leave = along[leaves & (along > enter)].min(initial=np.inf)
    if not np.isfinite(leave):
        raise InputError(source, "click", "does not go through the skin", "Click on the skin")
    middle: Array = origin + 0.5 * (enter + leave) * direction
    return middle
