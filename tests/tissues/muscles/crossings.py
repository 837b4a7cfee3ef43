"""Exact verdicts on two surfaces that share nothing with what the separation steers by."""

import numpy as np

from handpipe.mesh.surfaces.surface import Surface


def crossings(one: Surface, other: Surface) -> int:
    """How many edges of one pass through triangles of the other (Moeller and Trumbore 1997)."""
    ends = one.vertices[one.edges()]
    corners = other.vertices[other.triangles]
    low, high = other.vertices.min(axis=0), other.vertices.max(axis=0)
    ends = ends[((ends.max(axis=1) > low) & (ends.min(axis=1) < high)).all(axis=1)]
    count = 0
    for start in range(0, len(ends), 200):
        count += _hits(ends[start : start + 200], corners)
    return count


def _hits(ends: np.ndarray, corners: np.ndarray) -> int:
    origin, along = ends[:, None, 0], (ends[:, 1] - ends[:, 0])[:, None]
    first, second = corners[None, :, 1] - corners[None, :, 0], corners[None, :, 2] - corners[None, :, 0]
    p = np.cross(along, second)
    determinant = (first * p).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        arm = origin - corners[None, :, 0]
        u = (arm * p).sum(axis=2) / determinant
        q = np.cross(arm, first)
        v = (along * q).sum(axis=2) / determinant
        t = (second * q).sum(axis=2) / determinant
    return int(((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)).sum())


def inside(points: np.ndarray, surface: Surface) -> np.ndarray:
    """Which points have winding number one: all solid angles summed (Van Oosterom and Strackee 1983)."""
    parts = np.array_split(points, len(points) // 200 + 1)
    return np.concatenate([_turns(part, surface) for part in parts]) > 0.5


def _turns(points: np.ndarray, surface: Surface) -> np.ndarray:
    a, b, c = (surface.vertices[surface.triangles[:, i]] - points[:, None] for i in range(3))
    u, v, w = (np.linalg.norm(side, axis=2) for side in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=2)
    across = u * v * w + (a * b).sum(axis=2) * w + (b * c).sum(axis=2) * u + (c * a).sum(axis=2) * v
    return np.arctan2(volume, across).sum(axis=1) / (2 * np.pi)
