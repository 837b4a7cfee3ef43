"""Motions of a joint's child relative to its parent, pose by pose, and how well registration knows them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.bodies import bodies
from handpipe.skeleton.bones.registration_result import Registration
from handpipe.skeleton.joints.prior import MotionNoise

Bones = Mapping[str, RigidTransform]
Registrations = Mapping[str, Mapping[str, Registration]]  # pose -> bone


@dataclass(frozen=True)
class RelativeMotions:
    """Poses that have both bones, relative motions from neutral, and their noise (None: not known)."""

    poses: tuple[str, ...]
    relative: tuple[RigidTransform, ...]
    noise: tuple[MotionNoise, ...] | None

    def leave_one_out(self) -> Iterator[tuple[RelativeMotions, RigidTransform]]:
        """Every split into the motions of all poses but one and that one's; none where only one is there."""
        if len(self.poses) > 1:
            for i, left in enumerate(self.relative):
                yield self.without(i), left

    def without(self, i: int) -> RelativeMotions:
        """All motions but one."""

        def rest(items: tuple) -> tuple:
            return items[:i] + items[i + 1 :]

        noise = None if self.noise is None else rest(self.noise)
        return RelativeMotions(rest(self.poses), rest(self.relative), noise)


@dataclass(frozen=True)
class _Measured:
    """A registration, and the neutral point (3,) about which its covariance is."""

    registration: Registration
    middle: Array

    def deviations(self, point: Array) -> tuple[float, float]:
        """Of the turn in rad and of a neutral point (3,) in mm, root mean square."""
        arm = self.registration.transform.rotation @ (point - self.middle)
        return np.radians(self.registration.rotation_deviation), self.registration.deviation_at(arm)


class BoneNoise:
    """How well each pose's bones are known; bones that move as one are as well known as the best of them."""

    def __init__(
        self, dataset: Dataset, registrations: Registrations, surfaces: Mapping[str, Surface]
    ) -> None:
        self._poses = {
            pose: {b: _Measured(r, surfaces[b].vertices.mean(axis=0)) for b, r in found.items()}
            for pose, found in registrations.items()
        }
        for body in bodies(dataset):
            for bones in self._poses.values():
                there = [bones[b] for b in body if b in bones]
                if there:
                    best = min(there, key=lambda m: m.registration.rotation_deviation)
                    bones.update(dict.fromkeys(body, best))

    def of_motion(self, pose: str, parent: str, child: str, point: Array) -> MotionNoise:
        """Deviations by component of the child's motion relative to the parent, at a neutral point (3,)."""
        both = np.array([self._poses[pose][bone].deviations(point) for bone in (parent, child)])
        turn, shift = np.linalg.norm(both, axis=0) / np.sqrt(3)
        return MotionNoise(float(turn), float(shift))


def joint_motions(
    transforms: Mapping[str, Bones],
    parent: str,
    child: str,
    poses: Sequence[str],
    point: Array,
    noise: BoneNoise | None = None,
) -> RelativeMotions:
    """Motions of a joint's child relative to its parent, in the poses that have both.

    Parameters
    ----------
    transforms : mapping of str to mapping of str to RigidTransform
        Transforms from neutral by pose and bone.
    parent, child : str
        Bones of the joint.
    poses : sequence of str
        Poses to use.
    point : array (3,)
        Place of the joint in neutral, mm.
    noise : BoneNoise, optional
        How well each pose's bones are known.

    Returns
    -------
    RelativeMotions
        Relative motions, and their noise if it is given.
    """
    there = tuple(p for p in poses if parent in transforms[p] and child in transforms[p])
    relative = tuple(transforms[p][parent].inverse() @ transforms[p][child] for p in there)
    known = None if noise is None else tuple(noise.of_motion(p, parent, child, point) for p in there)
    return RelativeMotions(there, relative, known)
