"""Tendons with known truth: paths of constant length close to the bones, sliding at their proximal end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from handpipe.core import Array, RigidTransform
from handpipe.synthetic.geometry.implicit import Implicit
from handpipe.synthetic.geometry.kinematics import KnownJoint, Posture

STEP = 0.25  # mm between the points of a path while it is laid
CLEARANCE = 0.15  # mm that the tendon's surface keeps from bone
OVERLAP = 12.0  # mm by which bones' lines reach beyond their joints before they are cut


@dataclass(frozen=True)
class KnownTendon:
    """`side` -1 palmar, +1 dorsal; `line` (n, 3) the rough neutral path to the insertion; sizes in mm.

    `rounding` is the width in mm over which corners at the joints are smoothed.
    """

    name: str
    side: float
    radius: float
    line: Array
    length: float
    rounding: float = 2.0

    def path(self, posture: Posture, bones: Mapping[str, Implicit]) -> Array:
        """Whole posed path from the insertion to where it leaves the hand (n, 3), evenly spaced."""
        transforms = posture.transforms()
        line = self._lay(posture, transforms)
        line = _resample(line, STEP)
        line = _smooth(line, self.rounding)
        for _ in range(12):
            line = _smooth(_keep_off(line, bones, transforms, self.radius + CLEARANCE), 0.3 * self.rounding)
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
        joints = posture.joints
        names = [joints[0].parent, *(j.child for j in joints)]
        pieces = []
        for n, name in enumerate(names):
            mine = np.ones(len(self.line), dtype=bool)
            if n > 0:
                mine &= joints[n - 1].along(self.line) > -OVERLAP
            if n < len(joints):
                mine &= joints[n].along(self.line) < OVERLAP
            piece = transforms[name](self.line[mine])
            if n > 0:
                piece = _beyond(piece, joints[n - 1], posture, transforms, 1.0)
            if n < len(joints):
                piece = _beyond(piece, joints[n], posture, transforms, -1.0)
            pieces.append(piece)
            if n < len(joints) and self.side > 0:
                top = self.line[np.argmin(np.abs(joints[n].along(self.line)))]
                arc = joints[n].move(
                    np.repeat(top[None], 25, axis=0), posture.angles, np.linspace(0.0, 1.0, 25)
                )
                pieces.append(transforms[name](arc))
        return np.concatenate(pieces)


def _beyond(
    piece: Array,
    joint: KnownJoint,
    posture: Posture,
    transforms: Mapping[str, RigidTransform],
    side: float,
) -> Array:
    """Points beyond (`side` 1) or before (-1) a joint, by its half-way plane and the plane of their bone."""
    half = transforms[joint.parent] @ joint.transform(posture.angles, 0.5)
    bone = transforms[joint.child if side > 0 else joint.parent]
    for frame in (half, bone):
        normal = side * (frame.rotation @ joint.direction)
        piece = piece[(piece - frame(joint.centre[None])) @ normal > 0.0]
    return piece


def _resample(line: Array, step: float) -> Array:
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    keep = np.concatenate([[True], np.diff(arc) > 1e-9])
    at = np.linspace(0.0, arc[-1], max(int(arc[-1] / step), 8))
    return np.column_stack([np.interp(at, arc[keep], line[keep, d]) for d in range(3)])


def _smooth(line: Array, width: float) -> Array:
    """Gaussian smoothing over `width` mm with fixed ends (odd reflection about them)."""
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
