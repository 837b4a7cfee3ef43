"""Where each point lies on a hand: words, and a drawing of the shipped hand lying flat."""

from __future__ import annotations

from typing import Any

import fast_simplification
import numpy as np
from scipy.spatial import cKDTree

from handpipe.cli.person.played_hand import PlayedHand
from handpipe.core import Array, Frame, IntArray
from handpipe.hand import FINGERS

SKIN, BONE = 1500, 120  # triangles of the drawing: of the skin, of each bone
KINDS = {"tip": "tip", "DIP": "last joint", "IP": "joint", "PIP": "middle joint", "MP": "knuckle"}


def drawing(hand: PlayedHand) -> dict[str, Any]:
    """What a page draws of a right hand lying flat, seen from its back with the fingers up.

    Parameters
    ----------
    hand : PlayedHand
        The shipped right hand.

    Returns
    -------
    dict
        `points`: name, words and place `at` of each feature point, finger by finger; `skin` and `bones`:
        corners of triangles, six numbers each; all places in mm, right and down.
    """
    flat = Frame("flat", hand.flat, hand.rig.bone_transforms(hand.flat))
    shapes = hand.springs.frame(flat, judged=False)
    skin = shapes["skin"]["skin"]
    points = hand.template.feature_points
    nearest = cKDTree(skin.rest).query(np.array([*points.values()]))[1]
    at = dict(zip(points, _seen(skin.vertices[nearest]).tolist(), strict=True))
    order = sorted(points, key=lambda n: (n[-1], [*KINDS].index(n[:-1])))
    return {
        "points": [{"name": n, "words": _words(n), "at": at[n]} for n in order],
        "skin": _triangles(skin.vertices, skin.cells, SKIN),
        "bones": [
            t for bone in shapes["bones"].values() for t in _triangles(bone.vertices, bone.cells, BONE)
        ],
    }


def finger_words(finger: str) -> str:
    """Words for a finger of `FINGERS`: the thumb, the index finger."""
    return finger if finger == "thumb" else f"{finger} finger"


def _words(point: str) -> str:
    fingers = {number: name for name, number in FINGERS.items()}
    return f"{finger_words(fingers[point[-1]])}: {KINDS[point[:-1]]}"


def _triangles(vertices: Array, cells: IntArray, most: int) -> list[list[float]]:
    """Triangles of a coarser surface that face the eye, as they are seen."""
    points, faces = fast_simplification.simplify(
        vertices.astype(np.float32), cells.astype(np.int32), target_count=min(most, len(cells) - 1)
    )
    a, b, c = _seen(points)[faces].transpose(1, 0, 2)
    towards = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
    found: list[list[float]] = np.round(np.hstack([a, b, c])[towards], 1).tolist()
    return found


def _seen(points: Array) -> Array:
    """Points (n, 3) in mm of the template's frame as (n, 2) right and down: x is distal, y radial."""
    return -points[:, [1, 0]].astype(float)
