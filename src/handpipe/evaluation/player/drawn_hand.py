"""The part of a learned hand that a page draws: no fat beneath a skin, and bones with fewer triangles."""

from __future__ import annotations

from dataclasses import replace

import fast_simplification
import numpy as np

from handpipe.core import Array, IntArray
from handpipe.hand import tissue
from handpipe.levels import RIGID_LAYER, LearnedBody, LearnedHand

TRIANGLES = 2500  # of one bone: bones move exactly, so that only their outline is coarser


def drawn_hand(hand: LearnedHand, triangles: int = TRIANGLES) -> LearnedHand:
    """Leave out what a page does not draw.

    Parameters
    ----------
    hand : LearnedHand
        Hand of all bodies.
    triangles : int
        Triangles of a bone, at most.

    Returns
    -------
    LearnedHand
        Soft bodies as they are, then decimated bones, which follow their own bone alone.
    """
    skinned = any(tissue(*body) == "skin" for body in hand.bodies)
    fat = {body for body in hand.bodies if skinned and tissue(*body) == "fat"}
    soft = hand.only(lambda body: body[0] != RIGID_LAYER and body not in fat)
    bones = hand.only(lambda body: body[0] == RIGID_LAYER)
    coarse = {name: _decimated(body, triangles) for name, body in bones.bodies.items()}
    counts = [len(body.rest) for body in coarse.values()]
    joints, weights = _own_bones([hand.bones.index(name) for _, name in coarse], counts)
    return replace(
        soft,
        bodies={**soft.bodies, **coarse},
        joints=np.concatenate([soft.joints, joints]),
        weights=np.concatenate([soft.weights, weights]),
        dual=np.concatenate([soft.dual, np.zeros(len(joints), np.bool_)]),
        correctives=soft.correctives.with_plain(len(joints)),
    )


def _own_bones(numbers: list[int], counts: list[int]) -> tuple[IntArray, Array]:
    """Bones and weights (n, 4) of points that follow one bone each."""
    joints, weights = np.zeros((sum(counts), 4), np.int64), np.zeros((sum(counts), 4))
    joints[:, 0] = np.repeat(np.array(numbers, np.int64), counts)
    weights[:, 0] = 1.0
    return joints, weights


def _decimated(body: LearnedBody, triangles: int) -> LearnedBody:
    if len(body.cells) <= triangles:
        return body
    points, faces = fast_simplification.simplify(
        body.rest.astype(np.float32), body.cells.astype(np.int32), target_count=triangles
    )
    return replace(body, rest=points.astype(float), cells=faces.astype(np.int64), fields={})
