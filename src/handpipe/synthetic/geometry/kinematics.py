"""Known kinematics of a chain of bones: joints turn about fixed axes, plus small known residual motions.

A joint can move a point by a fraction of its motion. Tissue that spans a joint is posed by a fraction that
grows smoothly from 0 on the parent's side to 1 on the child's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform


@dataclass(frozen=True)
class KnownJoint:
    """A joint in the neutral frame.

    axes (k, 3) unit vectors, first flexion, then abduction, which carries the flexion axis; centre (3,) in
    mm; residual_rotation (3,) rotation vector in rad and residual_translation (3,) in mm that the joint adds
    when its first angle is 45 degrees, as the sine of twice the angle: no other axis or centre
    explains it; direction (3,), distal along the finger.
    """

    name: str
    parent: str
    child: str
    angles: tuple[str, ...]
    axes: Array
    centre: Array
    residual_rotation: Array
    residual_translation: Array
    direction: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))

    def along(self, points: Array) -> Array:
        """Distances (n,) in mm of neutral points (n, 3) beyond the plane across the finger at the centre."""
        return (points - self.centre) @ self.direction

    def move(self, points: Array, angles: Mapping[str, float], fraction: Array | float = 1.0) -> Array:
        """Move points (n, 3) by a fraction (n,) of the joint's motion at the angles (rad)."""
        share = np.broadcast_to(fraction, len(points))[:, None]
        growth = np.sin(2 * angles[self.angles[0]])
        moved = Rotation.from_rotvec(share * growth * self.residual_rotation).apply(points - self.centre)
        for name, axis in zip(self.angles, self.axes, strict=True):
            moved = Rotation.from_rotvec(share * angles[name] * axis).apply(moved)
        return moved + self.centre + share * growth * self.residual_translation

    def transform(self, angles: Mapping[str, float], fraction: float = 1.0) -> RigidTransform:
        """The joint's rigid motion of its child, in the neutral frame."""
        image = self.move(np.vstack([np.zeros(3), np.eye(3)]), angles, fraction)
        return RigidTransform((image[1:] - image[0]).T, image[0])


@dataclass(frozen=True)
class Posture:
    """One pose of a tree of bones: joints outwards, their angles in rad, and the root's repositioning.

    Bones of `with_root` move with the root bone, the first joint's parent.
    """

    joints: tuple[KnownJoint, ...]
    angles: Mapping[str, float]
    root: RigidTransform
    with_root: tuple[str, ...] = ()

    def transforms(self) -> dict[str, RigidTransform]:
        """Each bone's transform from the neutral frame into the pose's."""
        result = dict.fromkeys((self.joints[0].parent, *self.with_root), self.root)
        for joint in self.joints:
            result[joint.child] = result[joint.parent] @ joint.transform(self.angles)
        return result

    def bend(self, points: Array, fractions: Mapping[str, Array]) -> Array:
        """Pose neutral points (n, 3), each by its own fraction (n,) of every joint (absent: not at all)."""
        moved = points
        for joint in reversed(self.joints):
            if joint.name in fractions:
                moved = joint.move(moved, self.angles, fractions[joint.name])
        return self.root(moved)


def ramp(x: Array, start: float, end: float) -> Array:
    """From 0 at `start` to 1 at `end`, C1: slope rises over a fifth of the way, stays, and falls again.

    Flatter than a cubic, so that tissue on the inside of a bend is compressed less at its worst.
    """
    t = np.clip((x - start) / (end - start), 0.0, 1.0)
    rise = 0.2
    top = 1.0 / (1.0 - rise)
    low, high = 0.5 * top * t**2 / rise, 1.0 - 0.5 * top * (1.0 - t) ** 2 / rise
    middle = top * (t - 0.5 * rise)
    return np.where(t < rise, low, np.where(t > 1.0 - rise, high, middle))


def smoothstep(x: Array, start: float, end: float) -> Array:
    """Cubic from 0 at `start` to 1 at `end`."""
    t = np.clip((x - start) / (end - start), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)
