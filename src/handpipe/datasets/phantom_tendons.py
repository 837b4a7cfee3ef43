"""The phantom's tendons: paths of constant length close to the bones, which slide at their proximal end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from handpipe.datasets.implicit import Implicit
from handpipe.datasets.kinematics import Posture
from handpipe.mesh.rigid import RigidTransform

Array = NDArray[np.float64]

STEP = 0.25  # mm between the points of a path while it is laid
CLEARANCE = 0.15  # mm that the tendon's surface keeps from bone


@dataclass(frozen=True)
class KnownTendon:
    """`side` -1 palmar, +1 dorsal; `depth` (x, |z|) of the path, last the insertion; `length` in mm."""

    name: str
    side: float
    radius: float
    depth: tuple[tuple[float, float], ...]
    length: float

    def neutral_line(self) -> Array:
        """Centreline before relaxation, from proximal to distal (n, 3)."""
        knots = np.array(self.depth)
        x = np.arange(knots[0, 0], knots[-1, 0] + 1e-9, STEP)
        z = np.interp(x, knots[:, 0], knots[:, 1])
        return np.column_stack([x, np.zeros_like(x), self.side * z])

    def path(self, posture: Posture, bones: Mapping[str, Implicit]) -> Array:
        """Whole posed path from the insertion to where it leaves the hand (n, 3), evenly spaced."""
        transforms = posture.transforms()
        line = self._lay(posture, transforms)
        line = _resample(line, STEP)
        line = _smooth(line, 2.0)
        for _ in range(12):
            line = _smooth(_keep_off(line, bones, transforms, self.radius + CLEARANCE), 0.6)
        line = _keep_off(line, bones, transforms, self.radius + 0.5 * CLEARANCE)
        return _resample(line[::-1], STEP)

    def centreline(self, path: Array, points: int = 200) -> Array:
        """The tendon itself: the first `length` mm of its path, `points` evenly spaced points."""
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        spline = CubicSpline(arc, path)
        # A polyline is shorter than its curve: stretch the parameter until the polyline has the length.
        end = self.length
        for _ in range(4):
            line = spline(np.linspace(0.0, end, points))
            end *= self.length / np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        return spline(np.linspace(0.0, end, points))

    def _lay(self, posture: Posture, transforms: Mapping[str, RigidTransform]) -> Array:
        """Join the bones' lines: cut at each joint's half-way plane, or led around the joint on an arc."""
        line = self.neutral_line()
        starts = [-np.inf, *(j.centre[0] for j in posture.joints), np.inf]
        names = [posture.joints[0].parent, *(j.child for j in posture.joints)]
        pieces = []
        for n, name in enumerate(names):
            piece = transforms[name](
                line[(line[:, 0] > starts[n] - 12.0) & (line[:, 0] <= starts[n + 1] + 12.0)]
            )
            for joint, keep in ((n - 1, 1.0), (n, -1.0)):
                if 0 <= joint < len(posture.joints):
                    known = posture.joints[joint]
                    half = transforms[known.parent] @ known.transform(posture.angles, 0.5)
                    beyond = (piece - half(known.centre[None])) @ half.rotation[:, 0] * keep > 0.0
                    full = transforms[names[n]]
                    own_side = (piece - full(known.centre[None])) @ full.rotation[:, 0] * keep > 0.0
                    piece = piece[beyond & own_side]
            pieces.append(piece)
            if n < len(posture.joints):
                known = posture.joints[n]
                radius = np.interp(known.centre[0], *np.array(self.depth).T)
                top = known.centre * [1, 0, 0] + [0.0, 0.0, self.side * radius]
                share = np.linspace(0.0, 1.0, 25)
                arc = known.move(np.repeat(top[None], 25, axis=0), posture.angles, share)
                if self.side > 0:
                    pieces.append(transforms[known.parent](arc))
        return np.concatenate(pieces)


def _resample(line: Array, step: float) -> Array:
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(arc) > 1e-9])
    at = np.linspace(0.0, arc[-1], max(int(arc[-1] / step), 8))
    return np.column_stack([np.interp(at, arc[keep], line[keep, d]) for d in range(3)])


def _smooth(line: Array, width: float) -> Array:
    """Gaussian smoothing over `width` mm with the ends held (odd reflection about them)."""
    pad = int(4 * width / STEP) + 1
    before = 2.0 * line[0] - line[pad:0:-1]
    after = 2.0 * line[-1] - line[-2 : -pad - 2 : -1]
    return gaussian_filter1d(np.concatenate([before, line, after]), width / STEP, axis=0)[pad:-pad]


def _keep_off(
    line: Array, bones: Mapping[str, Implicit], transforms: Mapping[str, RigidTransform], distance: float
) -> Array:
    """Push points straight out of bones until they are `distance` away."""
    for name, shape in bones.items():
        local = transforms[name].inverse()(line)
        near = np.flatnonzero(shape(local) < distance)
        for _ in range(3 if len(near) else 0):
            value = shape(local[near])
            step = 1e-4 * np.eye(3)
            slope = np.stack([shape(local[near] + e) - shape(local[near] - e) for e in step], axis=1) / 2e-4
            slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 0.3)
            local[near] += np.maximum(distance - value, 0.0)[:, None] * slope
        line = transforms[name](local)
    return line


def tendons() -> dict[str, KnownTendon]:
    """Flexor and extensor of the finger."""
    return {
        "flexor2": KnownTendon(
            "flexor2",
            -1.0,
            1.8,
            (
                (-7.0, 8.6),
                (20.0, 8.2),
                (48.0, 8.9),
                (58.0, 9.4),
                (66.0, 8.8),
                (82.0, 6.6),
                (101.4, 6.9),
                (112.0, 6.0),
            )
            + ((118.0, 5.5), (127.0, 5.6), (136.0, 5.0)),
            105.5,
        ),
        "extensor2": KnownTendon(
            "extensor2",
            1.0,
            1.3,
            ((-7.0, 8.4), (20.0, 7.0), (45.0, 6.9), (54.0, 8.4), (58.2, 8.7), (70.0, 7.6), (80.0, 6.2))
            + ((95.0, 5.6), (101.4, 5.7), (110.0, 6.1), (117.0, 5.0), (127.0, 4.8), (134.5, 4.9)),
            137.0,
        ),
    }
