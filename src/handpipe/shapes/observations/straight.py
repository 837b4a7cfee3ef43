"""Attachments so nearly on a line that they do not determine the rotation about it.

If points are off a line by only a small share of its length, their errors decide the rotation about it, and
springs with such short lever arms would impose it against all marks. The springs then act on the line alone,
and the points themselves count as landmarks, besides the marks.
"""

from __future__ import annotations

import logging

import numpy as np

from handpipe.core import Array
from handpipe.shapes.observations.marks import Pairs

log = logging.getLogger(__name__)

NEARLY = 0.05  # spread across a line over that along it


def direction(points: Array) -> tuple[Array, float]:
    """Unit vector (3,) of the line through points (k, 3), and their spread across it over that along it."""
    _, spreads, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return axes[0], float(spreads[1] / max(spreads[0], 1e-300)) if len(spreads) > 1 else 0.0


def on_line(points: Array) -> bool:
    """Whether points (k, 3) do not determine the rotation about a line."""
    return direction(points)[1] < NEARLY


def in_space(points: Array) -> bool:
    """Whether points (k, 3) are so far from any plane that they determine uniform strains."""
    if len(points) < 4:
        return False
    spreads = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spreads[2] >= NEARLY * spreads[0])


def loosened(attachments: Pairs | None, landmarks: Pairs | None) -> tuple[Pairs | None, Pairs | None]:
    """Attachments nearly on a line put on it, and landmarks with these; any others as they are."""
    if attachments is None or len(attachments.points) < 3:
        return attachments, landmarks
    if not (on_line(attachments.points) or on_line(attachments.targets)):
        return attachments, landmarks
    log.info("attachments are on a line, or nearly: marks and landmarks decide the rotation about it")
    every = [attachments] if landmarks is None else [attachments, landmarks]
    known = Pairs(np.concatenate([p.points for p in every]), np.concatenate([p.targets for p in every]))
    return Pairs(_projected(attachments.points), _projected(attachments.targets)), known


def _projected(points: Array) -> Array:
    centre, axis = points.mean(axis=0), direction(points)[0]
    return centre + ((points - centre) @ axis)[:, None] * axis
