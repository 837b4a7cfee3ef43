"""Where landmarks are on the bones of a hand that a page fits to them, and which place its palm."""

from __future__ import annotations

from typing import Any

from handpipe.levels import LearnedHand
from handpipe.skeleton.drivers import LANDMARK_NUMBERS, LANDMARKS, landmark_map
from handpipe.skeleton.rig import Rig

LEAST = 3  # landmarks that place a palm


def landmark_places(hand: LearnedHand, rig: Rig, side: str) -> dict[str, Any] | None:
    """Landmarks of a hand as the page's script has them; None without a palm that places them."""
    where = landmark_map(rig)
    palm = where.palm(rig)
    if len(palm) < LEAST:
        return None
    return {
        "names": LANDMARKS,
        "hand": side,
        "places": {n: [hand.bones.index(bone), point.tolist()] for n, (bone, point) in where.places.items()},
        "segments": [*where.segments.values()],
        "palm": palm,
        "by": LANDMARK_NUMBERS,
    }
