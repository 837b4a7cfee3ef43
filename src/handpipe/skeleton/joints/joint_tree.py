"""The tree of fitted joints: joint angles to the rigid transforms of all bones (Wang 2019, Eq. 2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError, RigidTransform
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.angles import Angles, check_angles
from handpipe.skeleton.joints.joint_knowledge import JointKnowledge
from handpipe.skeleton.joints.joints import JointFit, Model

Bones = Mapping[str, RigidTransform]


@dataclass(frozen=True)
class RigJoint:
    """A fitted joint in the tree: names of its angles, and their limits (dof, 2) in rad."""

    name: str
    parent: str
    child: str
    angles: tuple[str, ...]
    limits: Array
    fit: JointFit
    knowledge: JointKnowledge | None = None  # of a joint that was fitted to poses


@dataclass(frozen=True)
class FittedPose:
    """A scanned pose as the rig explains it: the root bone's registered transform, and the angles in rad.

    undetermined: names of angles that the pose's bones do not tell; their values are assumed.
    """

    root: RigidTransform
    angles: Angles
    undetermined: frozenset[str] = frozenset()

    @property
    def known(self) -> Angles:
        """The angles that the pose's bones tell."""
        return {name: value for name, value in self.angles.items() if name not in self.undetermined}


class ScannedBones(dict[str, RigidTransform]):
    """Bone -> transform in a scanned pose; to ask for a bone that the pose does not tell is an error."""

    def __init__(self, pose: str, bones: Bones) -> None:
        super().__init__(bones)
        self.pose = pose

    def __missing__(self, bone: str) -> RigidTransform:
        """Raises `InputError`: the pose's scan does not determine the bone's transform."""
        raise InputError(
            "rig",
            f"poses.{self.pose}",
            f"nothing in this pose's scan tells where {bone} is, which what is modelled needs",
            "Correct it by `scribbles` in the dataset file, or leave the pose out",
        )


@dataclass(frozen=True)
class JointTree:
    """Joints in order from the root outwards; neutral bone surfaces; scanned poses as it explains them.

    Limits, twists, explained poses and files are computed from it; `rig.Rig` is fitted to poses, too.
    """

    root: str
    joints: tuple[RigJoint, ...]
    surfaces: dict[str, Surface]
    poses: dict[str, FittedPose]

    @property
    def bones(self) -> tuple[str, ...]:
        """Bone names, the root first, parents before children."""
        return (self.root, *(j.child for j in self.joints))

    @property
    def parents(self) -> dict[str, str]:
        """Bone -> parent bone, without the root."""
        return {j.child: j.parent for j in self.joints}

    @property
    def angle_names(self) -> tuple[str, ...]:
        """Names of all angles, in the order of the joints."""
        return tuple(name for j in self.joints for name in j.angles)

    @property
    def limits(self) -> dict[str, tuple[float, float]]:
        """Angle name -> lower and upper limit in rad."""
        return {
            n: (float(a), float(b)) for j in self.joints for n, (a, b) in zip(j.angles, j.limits, strict=True)
        }

    def check_limits(self, angles: Mapping[str, float], source: str | Path) -> None:
        """Raise `InputError` for an angle (rad) that is unknown, missing, not finite or beyond its limits."""
        check_angles(angles, self.limits, source)

    def bone_transforms(
        self, angles: Mapping[str, float], root: RigidTransform | None = None, model: Model = "full"
    ) -> dict[str, RigidTransform]:
        """Transforms from neutral of all bones at the given angles in rad (Wang 2019, Eq. 2).

        root: the root bone's transform, at rest if None; model "partial" leaves the residual motions out.
        """
        transforms = {self.root: RigidTransform.identity() if root is None else root}
        for joint in self.joints:
            values = np.array([angles[n] for n in joint.angles])
            transforms[joint.child] = transforms[joint.parent] @ joint.fit.transform(values, model)
        return transforms

    def scanned_bones(self, pose: str) -> ScannedBones:
        """Transforms from neutral of a scanned pose's bones, the root at rest, as the rig explains them.

        A bone that hangs on an angle that the pose does not tell is not among them. Raises `InputError` for
        a pose that the rig does not explain.
        """
        if pose not in self.poses:
            problem = f"its root bone {self.root} is missing or in doubt"
            raise InputError("rig", f"poses.{pose}", problem, "Mend its seeds, or leave the pose out")
        fitted, known = self.poses[pose], {self.root}
        for joint in self.joints:
            if joint.parent in known and not fitted.undetermined & set(joint.angles):
                known.add(joint.child)
        found = self.bone_transforms(fitted.angles)
        return ScannedBones(pose, {bone: t for bone, t in found.items() if bone in known})
