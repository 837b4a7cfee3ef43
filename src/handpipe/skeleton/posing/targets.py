"""What inverse kinematics may ask of points and directions on bones; all residuals are in mm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.rig.twists import MovingBone

LEVER = 30.0  # mm; a rotation counts as the displacement at this distance


class Target(Protocol):
    """Something that is met where its residual (k,) in mm is zero."""

    @property
    def bones(self) -> tuple[str, ...]:
        """Bones that it speaks of."""
        ...

    def residual(self, bones: Mapping[str, MovingBone]) -> tuple[Array, Array]:
        """Residual (k,) in mm and its derivatives (k, n) in mm per rad by the rig's angles."""
        ...


@dataclass(frozen=True)
class Position:
    """A point of a bone, given in neutral (3,) in mm, is to lie at `place` (3,) in mm.

    The point need not lie on the bone's surface: a finger pad moves with its bone, too. `weight` is what a
    millimetre counts beside other targets.
    """

    bone: str
    point: Array
    place: Array
    weight: float = 1.0

    @property
    def bones(self) -> tuple[str, ...]:
        """The bone of the point."""
        return (self.bone,)

    def residual(self, bones: Mapping[str, MovingBone]) -> tuple[Array, Array]:
        """Weighted offset (3,) in mm of the point from `place`, and its derivatives (3, n) in mm per rad."""
        bone = bones[self.bone]
        return self.weight * (bone.transform(self.point) - self.place), self.weight * bone.velocities(
            self.point
        ).T


@dataclass(frozen=True)
class Meeting:
    """Two points, each given in neutral (3,) in mm on its bone, are to meet wherever that may be."""

    bone: str
    point: Array
    other: str
    other_point: Array
    weight: float = 1.0

    @property
    def bones(self) -> tuple[str, ...]:
        """The bones of both points."""
        return (self.bone, self.other)

    def residual(self, bones: Mapping[str, MovingBone]) -> tuple[Array, Array]:
        """Weighted offset (3,) in mm between the points, and its derivatives (3, n) in mm per rad."""
        gap, rates = _gap(bones[self.bone], self.point, bones[self.other], self.other_point)
        return self.weight * gap, self.weight * rates.T


@dataclass(frozen=True)
class Orientation:
    """A bone's rotation from neutral (3, 3) is to be `rotation`.

    The residual is the difference of the matrices, smooth for every angle; its norm is
    2 `lever` sin(angle / 2), near zero `lever` times the angle.
    """

    bone: str
    rotation: Array
    lever: float = LEVER

    @property
    def bones(self) -> tuple[str, ...]:
        """The bone that is oriented."""
        return (self.bone,)

    def residual(self, bones: Mapping[str, MovingBone]) -> tuple[Array, Array]:
        """Scaled difference (9,) in mm of the rotations, and its derivatives (9, n) in mm per rad."""
        bone, scale = bones[self.bone], self.lever / np.sqrt(2)
        columns = bone.transform.rotation.T  # (3, 3), one column of the rotation a row
        rates = np.cross(bone.angular[:, None, :], columns[None])  # (n, 3, 3)
        difference = columns - self.rotation.T
        return scale * difference.ravel(), scale * rates.reshape(len(rates), 9).T


@dataclass(frozen=True)
class Direction:
    """The way from a point to another, each in neutral (3,) on its bone, is to have a unit direction (3,)."""

    bone: str
    point: Array
    other: str
    other_point: Array
    along: Array
    lever: float = LEVER

    @property
    def bones(self) -> tuple[str, ...]:
        """The bones of both points."""
        return (self.bone, self.other)

    def residual(self, bones: Mapping[str, MovingBone]) -> tuple[Array, Array]:
        """Difference (3,) in mm of the directions times `lever`, and its derivatives (3, n) in mm per rad."""
        gap, rates = _gap(bones[self.other], self.other_point, bones[self.bone], self.point)
        length = float(np.linalg.norm(gap))
        direction = gap / length
        turned = (rates - np.outer(rates @ direction, direction)) / length
        return self.lever * (direction - self.along), self.lever * turned.T


@dataclass(frozen=True)
class Apart:
    """A point of a bone is not to lie inside another bone, deeper than `allowed` mm beyond a plane of it.

    The plane passes `other_point` (3,) with the outward unit `normal` (3,), both of the other bone in
    neutral.
    """

    bone: str
    point: Array
    other: str
    other_point: Array
    normal: Array
    allowed: float = 0.0
    weight: float = 1.0

    @property
    def bones(self) -> tuple[str, ...]:
        """Both bones."""
        return (self.bone, self.other)

    def residual(self, bones: Mapping[str, MovingBone]) -> tuple[Array, Array]:
        """Weighted depth (1,) in mm, zero outside, and its derivatives (1, n) in mm per rad."""
        a, b = bones[self.bone], bones[self.other]
        normal = b.transform.rotation @ self.normal
        gap, gap_rates = _gap(a, self.point, b, self.other_point)
        height = float(normal @ gap) + self.allowed
        if height >= 0:
            return np.zeros(1), np.zeros((1, len(a.angular)))
        turned = np.cross(b.angular, normal) @ gap
        rates = gap_rates @ normal + turned
        return np.array([self.weight * height]), self.weight * rates[None]


def _gap(a: MovingBone, point: Array, b: MovingBone, other: Array) -> tuple[Array, Array]:
    """Way (3,) in mm to a point of bone `a` from one of `b`, and its derivatives (n, 3) in mm per rad."""
    return a.transform(point) - b.transform(other), a.velocities(point) - b.velocities(other)
