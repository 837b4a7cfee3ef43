"""The rigid motion that brings a scan onto the image's skin, from wherever it is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, BoolArray, RigidTransform
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.scan_alignment.matches import Matches
from handpipe.skeleton.scan_alignment.smooth_offset import vertex_areas

COARSE, FINE = 400, 4000  # vertices of the scan that are matched
ROLLS = 6  # starts about the long axis
ALONG = (-0.12, 0.0, 0.12)  # starts along it, as a share of the length: scan and image end elsewhere
ROUNDS, LAST_ROUNDS = 14, 40  # of each start, and of the best ones
KEPT = 0.85  # share of the distances that a score takes
BEST = 3  # starts that are refined
WRONG_SIDE = 4.0  # mm that a match with a wrong normal counts for
STILL = 1e-4  # rad, and mm over 10
TIGHTENING, LEAST = 0.7, 0.1  # 1 and mm: of the least deviation of a bulk, by round, down to this
FEWEST = 12  # matches with which a motion is determined


def rigid_start(scan: Surface, skin: Surface, trusted: BoolArray) -> RigidTransform:
    """The motion into the frame of the skin with the least trimmed distances, from starts all around."""
    distance = Distance(skin)
    points, normals = thinned(scan, COARSE)
    found = []
    for start in _starts(scan.vertices, skin.vertices[trusted]):
        motion = icp(points, normals, distance, trusted, start, ROUNDS)
        found.append((_score(points, normals, distance, trusted, motion), motion))
    found.sort(key=lambda pair: pair[0])
    points, normals = thinned(scan, FINE)
    last = [icp(points, normals, distance, trusted, motion, LAST_ROUNDS) for _, motion in found[:BEST]]
    return min(last, key=lambda motion: _score(points, normals, distance, trusted, motion))


def thinned(scan: Surface, count: int) -> tuple[Array, Array]:
    """`count` vertices (k, 3) at most with their normals (k, 3), drawn by the area around them."""
    rng = np.random.default_rng(0)
    areas = vertex_areas(scan)
    count = min(count, int((areas > 0).sum()))
    chosen = np.sort(rng.choice(len(areas), count, replace=False, p=areas / areas.sum()))
    return scan.vertices[chosen], scan.vertex_normals()[chosen]


def icp(
    points: Array, normals: Array, skin: Distance, trusted: BoolArray, start: RigidTransform, rounds: int
) -> RigidTransform:
    """Motion after iterations of closest places and distances to tangent planes, outliers trimmed."""
    motion, least = start, 2.0
    for _ in range(rounds):
        here = motion(points)
        match = Matches.find(here, normals @ motion.rotation.T, skin, trusted)
        weights = match.weights(least)
        if np.count_nonzero(weights) < FEWEST:
            return motion
        middle = here.mean(axis=0)
        rows = np.hstack([np.cross(here - middle, match.normals), match.normals])
        step = _least_squares(rows, -match.signed, weights)
        turn = RigidTransform.about(middle, Rotation.from_rotvec(step[:3]).as_matrix())
        motion = RigidTransform(np.eye(3), step[3:]) @ turn @ motion
        least = max(TIGHTENING * least, LEAST)
        if np.abs(step[:3]).max() < STILL and np.abs(step[3:]).max() < 10 * STILL:
            return motion
    return motion


def _least_squares(rows: Array, right: Array, weights: Array) -> Array:
    weighted = rows * weights[:, None]
    matrix = weighted.T @ rows
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-12))
    scaled = matrix / np.outer(scale, scale) + 1e-6 * np.eye(6)
    return np.linalg.solve(scaled, (weighted.T @ right) / scale) / scale


def _score(
    points: Array, normals: Array, skin: Distance, trusted: BoolArray, motion: RigidTransform
) -> float:
    match = Matches.find(motion(points), normals @ motion.rotation.T, skin, trusted)
    apart = np.where(match.valid, np.abs(match.signed), np.maximum(np.abs(match.signed), WRONG_SIDE))
    return float(np.sort(apart)[: max(1, int(KEPT * len(apart)))].mean())


def _starts(scan: Array, skin: Array) -> Iterator[RigidTransform]:
    """As it is; moved to the skin's middle; turned to its principal axes, rolled and shifted along them."""
    yield RigidTransform.identity()
    a, b = scan.mean(axis=0), skin.mean(axis=0)
    yield RigidTransform(np.eye(3), b - a)
    source, target = _axes(scan), _axes(skin)
    length = float(np.ptp((skin - b) @ target[0]))
    for way in (1.0, -1.0):
        for angle in np.arange(ROLLS) * 2 * np.pi / ROLLS:
            roll = Rotation.from_rotvec(angle * target[0]).as_matrix()
            flip = target * np.array([way, way, 1.0])[:, None]
            rotation = roll @ flip.T @ source
            for share in ALONG:
                yield RigidTransform(rotation, b + share * length * target[0] - rotation @ a)


def _axes(points: Array) -> Array:
    """Principal axes as rows of a right-handed frame, the longest first."""
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    axes[2] = np.cross(axes[0], axes[1])
    return axes
