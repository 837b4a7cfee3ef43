"""Rigid registration of a neutral marrow surface to the same bone in another pose (Wang 2019, section 3.1).

Iterated closest points with distances to tangent planes, from many starts: a phalanx is nearly a solid of
revolution, and only its condyles tell the rotation about its long axis.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handpipe.errors import ConvergenceError
from handpipe.imaging.volume import Volume
from handpipe.mesh.distance import Distance, sample_points
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.skeleton.edge_refinement import refine_to_edges
from handpipe.skeleton.normal_equations import Rows, covariance, moved, robust_weights, solve
from handpipe.skeleton.registration_result import Registration, rotation_uncertainty

Array = NDArray[np.float64]
LOG = logging.getLogger(__name__)

ROLLS = 8  # starts about the long axis
KEPT_POINTS = {"target": 0.95, "neutral": 0.4}  # a target may lack much of the bone, but seldom has more
COARSE, FINE, VERTICES = 300, 1500, 6000  # points in the stages
WORST = 0.05  # residual by the bone's size beyond which the surfaces are of different bones
STILL = 1e-5  # rad, and mm per mm of the bone's size


@dataclass(frozen=True)
class _Pair:
    """The two surfaces ready for closest-point queries, and the neutral's mean (3,)."""

    neutral: Distance
    target: Distance
    middle: Array

    def target_rows(self, transform: RigidTransform, points: Array) -> Rows:
        """Distances of target points from the moved neutral surface."""
        distance, _, closest, normals = self.neutral.signed(transform.inverse()(points))
        return Rows.of(transform(closest), normals @ transform.rotation.T, distance, transform(self.middle))

    def neutral_rows(self, transform: RigidTransform, points: Array) -> Rows:
        """Distances of moved neutral points from the target surface."""
        moved = transform(points)
        distance, _, _, normals = self.target.signed(moved)
        return Rows.of(moved, normals, -distance, transform(self.middle))


def register(
    neutral_marrow: Surface,
    target_marrow: Surface,
    *,
    volume: Volume | None = None,
    start: RigidTransform | Sequence[RigidTransform] | None = None,
) -> Registration:
    """Rigid transform that carries the neutral surface onto the target, of least residual over all starts.

    start: guesses from elsewhere, such as the parent's transform; the principal axes give more. volume: image
    of the target pose; the result is then refined to the image's edge between bright marrow and dark shell. A
    target that lacks a part of the bone is registered by the rest. Raises `ConvergenceError` where the
    surfaces do not fit one another at all.
    """
    pair = _Pair(Distance(neutral_marrow), Distance(target_marrow), neutral_marrow.vertices.mean(axis=0))
    guesses = [start] if isinstance(start, RigidTransform) else list(start or [])
    coarse = _best(pair, [*guesses, *principal_starts(neutral_marrow, target_marrow)], COARSE, iterations=15)
    fine = _best(pair, coarse[:4], FINE, iterations=40)
    found = _finish(pair, fine[0], target_marrow)
    size = np.sqrt(neutral_marrow.area())
    if not np.isfinite(found.rms) or found.rms > WORST * size:
        raise ConvergenceError("Registration", f"residual {found.rms:.2f} mm at a bone of size {size:.1f} mm")
    LOG.info(
        "registered: rms %.3f mm, uncertainty %s deg", found.rms, np.round(rotation_uncertainty(found), 2)
    )
    return found if volume is None else refine_to_edges(neutral_marrow, volume, found)


def principal_starts(neutral: Surface, target: Surface) -> list[RigidTransform]:
    """Long axis on long axis, either way round, rolled about it, and end on end if lengths differ."""
    a, b = _principal(neutral), _principal(target)
    starts = []
    for flip in (np.eye(3), np.diag([-1.0, -1.0, 1.0])):
        for roll in np.linspace(0, 2 * np.pi, ROLLS, endpoint=False):
            turn = Rotation.from_rotvec([roll, 0, 0]).as_matrix() @ flip
            rotation = b.axes @ turn @ a.axes.T
            for shift in _end_shifts(a.length, b.length):
                translation = b.centre + shift * b.axes[:, 0] - rotation @ a.centre
                starts.append(RigidTransform(rotation, translation))
    return starts


@dataclass(frozen=True)
class _Principal:
    """Centre (3,), right-handed principal axes (3, 3) in columns, the long one first; length along it."""

    centre: Array
    axes: Array
    length: float


def _principal(surface: Surface) -> _Principal:
    points = sample_points(surface, 2000)
    centre = points.mean(axis=0)
    axes = np.linalg.eigh(np.cov(points.T))[1][:, ::-1]
    axes = axes * [1, 1, np.sign(np.linalg.det(axes))]
    return _Principal(centre, axes, float(np.ptp(points @ axes[:, 0])))


def _end_shifts(a: float, b: float) -> tuple[float, ...]:
    half = abs(a - b) / 2
    return (0.0, half, -half) if half > 0.07 * max(a, b) else (0.0,)


def _best(pair: _Pair, starts: Sequence[RigidTransform], count: int, iterations: int) -> list[RigidTransform]:
    """The starts brought to the target, those of least residual first."""
    samples = (
        sample_points(pair.target.surface, count, seed=1),
        sample_points(pair.neutral.surface, count, seed=2),
    )
    scored = [_align(pair, start, *samples, iterations) for start in starts]
    return [transform for _, transform in sorted(scored, key=lambda s: s[0])]


def _align(
    pair: _Pair, transform: RigidTransform, target: Array, neutral: Array, iterations: int
) -> tuple[float, RigidTransform]:
    """Trimmed mean square of both surfaces' distances in mm^2, and the transform that makes it small."""
    for i in range(iterations):
        rows = [pair.target_rows(transform, target)]
        # The neutral's points keep the target from covering only a part; later on, a target that lacks a part
        # must not be drawn towards where that part would be.
        if i < iterations // 2:
            rows.append(pair.neutral_rows(transform, neutral))
        step = solve(Rows.joined(rows), np.concatenate([robust_weights(r.distance) for r in rows]))
        transform = moved(transform, step, pair.middle)
        if i >= iterations // 2 and _is_still(step, pair):
            break
    a = pair.target_rows(transform, target).distance
    b = pair.neutral_rows(transform, neutral).distance
    return _trimmed(a, KEPT_POINTS["target"]) + _trimmed(b, KEPT_POINTS["neutral"]), transform


def _finish(pair: _Pair, transform: RigidTransform, target: Surface) -> Registration:
    """Last iterations on the target's own vertices, whose noise gives the covariance."""
    stride = int(np.ceil(len(target.vertices) / VERTICES))
    points = target.vertices[::stride]
    for _ in range(40):
        rows = pair.target_rows(transform, points)
        step = solve(rows, robust_weights(rows.distance))
        transform = moved(transform, step, pair.middle)
        if _is_still(step, pair):
            break
    every = pair.target_rows(transform, target.vertices)
    weights = robust_weights(every.distance)
    rms = float(np.sqrt((weights * every.distance**2).sum() / weights.sum()))
    return Registration(transform, rms, covariance(every, weights, target.edges()))


def _is_still(step: Array, pair: _Pair) -> bool:
    size = np.sqrt(pair.neutral.surface.area())
    return bool(np.abs(step[:3]).max() < STILL and np.abs(step[3:]).max() < STILL * size)


def _trimmed(distances: Array, kept: float) -> float:
    squares = np.sort(distances**2)
    return float(squares[: max(1, int(kept * len(squares)))].mean())
