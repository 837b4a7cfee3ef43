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
    """A fitted joint in the tree.

    Parameters
    ----------
    name : str
        Name of the joint.
    parent, child : str
        Bones that it connects.
    angles : tuple of str
        Names of its angles.
    limits : array (dof, 2)
        Lower and upper limit of each angle in rad.
    fit : JointFit
        Motion of the child at given angles.
    knowledge : JointKnowledge, optional
        How well the joint is known; None if it was not fitted to poses.
    """

    name: str
    parent: str
    child: str
    angles: tuple[str, ...]
    limits: Array
    fit: JointFit
    knowledge: JointKnowledge | None = None  # of a joint that was fitted to poses


@dataclass(frozen=True)
class FittedPose:
    """A scanned pose as the rig explains it.

    Parameters
    ----------
    root : RigidTransform
        Registered transform of the root bone from neutral, mm.
    angles : dict of str to float
        Angles in rad by name.
    undetermined : frozenset of str
        Angles that the pose's bones do not determine; their values are assumed.
    """

    root: RigidTransform
    angles: Angles
    undetermined: frozenset[str] = frozenset()

    @property
    def known(self) -> Angles:
        """The angles that the pose's bones determine."""
        return {name: value for name, value in self.angles.items() if name not in self.undetermined}


class ScannedBones(dict[str, RigidTransform]):
    """Bone -> transform in a scanned pose; to ask for a bone that the pose does not determine is an error."""

    def __init__(self, pose: str, bones: Bones) -> None:
        super().__init__(bones)
        self.pose = pose

    def __missing__(self, bone: str) -> RigidTransform:
        """Raise `InputError`: the pose's scan does not determine the bone's transform."""
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
        """Transforms of all bones from neutral at given angles.

        Parameters
        ----------
        angles : mapping of str to float
            All angles in rad by name.
        root : RigidTransform, optional
            Transform of the root bone from neutral, by default the identity.
        model : str
            "full", or "partial" without the residual motions.

        Returns
        -------
        dict of str to RigidTransform
            Transforms by bone, mm.

        References
        ----------
        Wang 2019 §4, Eq. 2.
        """
        transforms = {self.root: RigidTransform.identity() if root is None else root}
        for joint in self.joints:
            values = np.array([angles[n] for n in joint.angles])
            transforms[joint.child] = transforms[joint.parent] @ joint.fit.transform(values, model)
        return transforms

    def scanned_bones(self, pose: str) -> ScannedBones:
        """Transforms of a scanned pose's bones from neutral as the rig explains them, with the root at rest.

        Parameters
        ----------
        pose : str
            Name of the pose.

        Returns
        -------
        ScannedBones
            Transforms by bone, without the bones whose place depends on an angle that the pose does not
            determine.

        Raises
        ------
        InputError
            If the rig does not explain the pose.
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
