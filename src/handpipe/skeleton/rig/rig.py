"""The bone rig: joint angles to the rigid transforms of all bones, and back (Wang 2019, section 4)."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from handpipe.core import Array, InputError, RigidTransform, artifacts
from handpipe.core.configuration import Dataset, Joint, joint_order
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.bones.bodies import moved_as_one
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.axes import Axes
from handpipe.skeleton.joints.joint_knowledge import JointKnowledge
from handpipe.skeleton.joints.joint_tree import Bones, FittedPose, JointTree, RigJoint
from handpipe.skeleton.joints.joint_types import fit_best
from handpipe.skeleton.joints.joints import JointFit, Model, fit_joint
from handpipe.skeleton.joints.limits import widened_limits
from handpipe.skeleton.joints.residual import Residual
from handpipe.skeleton.rig.explaining import explain
from handpipe.skeleton.rig.motions import BoneNoise, Registrations, RelativeMotions, joint_motions
from handpipe.skeleton.rig.rig_groups import angles_of_group, knowledge_of_group, rig_groups, rig_units

LOG = logging.getLogger(__name__)
ANY_ANGLE = ((-180.0, 180.0),)  # deg, of an angle without limits
END = 0.02  # quantile of the distances to the other bone: where the joint is


@dataclass(frozen=True)
class Rig(JointTree):
    """A tree of joints that is fitted to scanned poses, and kept in a file.

    Parameters
    ----------
    root : str
        Bone from which the tree starts.
    joints : tuple of RigJoint
        Fitted joints, from the root outwards.
    surfaces : dict of str to Surface
        Neutral bone surfaces, mm.
    poses : dict of str to FittedPose
        Scanned poses as the rig explains them.
    """

    @staticmethod
    def fit(
        dataset: Dataset,
        transforms: Mapping[str, Bones],
        surfaces: Mapping[str, Surface],
        fit_poses: Sequence[str],
        registrations: Registrations | None = None,
    ) -> Rig:
        """Fit every joint to the given poses, then explain all poses.

        A joint of which no pose has both bones keeps its hints and the gap of its bones: `RigJoint.knowledge`
        says what the poses determine, a warning names what they do not. Limits that the dataset does not
        state are those of `limits.widened_limits`.

        Parameters
        ----------
        dataset : Dataset
            Dataset with bones and joints.
        transforms : mapping of str to mapping of str to RigidTransform
            Transforms from neutral in the pose's scanner frame (mm), by pose and bone. A pose that lacks a
            bone is left out for that bone's joints. Bones without a degree of freedom between them are moved
            as one.
        surfaces : mapping of str to Surface
            Neutral bone surfaces, mm.
        fit_poses : sequence of str
            Poses to learn from. The other poses in `transforms` are only explained.
        registrations : mapping of str to mapping of str to Registration, optional
            How well each transform is known, by pose and bone. With them, motions are weighted accordingly,
            and the dataset's hints count where motions tell little.

        Returns
        -------
        Rig
            The fitted rig.

        Raises
        ------
        InputError
            If neutral lacks a bone.
        """
        for bone in dataset.bones:
            if bone not in surfaces:
                problem = f"{bone} was not found in the neutral pose {dataset.neutral}"
                raise InputError(dataset.name, f"bones.{bone}", problem, "Draw its seeds in neutral anew")
        noise = None if registrations is None else BoneNoise(dataset, registrations, surfaces)
        transforms = moved_as_one(dataset, transforms, surfaces)
        joints: list[RigJoint] = []
        learnt = [p for p in fit_poses if p != dataset.neutral]  # neutral is the zero of every joint
        for name in outwards(dataset):
            joint = dataset.joints[name]
            near = joint_point(surfaces[joint.parent], surfaces[joint.child])
            motions = joint_motions(transforms, joint.parent, joint.child, learnt, near, noise)
            fit = _fit_joint(joint, motions, near, surfaces[joint.child].vertices.mean(axis=0))
            limits = np.radians(np.array(joint.limits_deg or ANY_ANGLE * len(joint.angles), float))
            knowledge = JointKnowledge.assess(fit, motions.relative, motions.noise)
            ends = joint.parent, joint.child
            joints.append(RigJoint(name, *ends, joint.angles, limits.reshape(-1, 2), fit, knowledge))
            _warn_of_joint(joints[-1], len(learnt))
        rig = Rig(dataset.root_bone, tuple(joints), {b: surfaces[b] for b in dataset.bones}, {})
        free = {name for name, joint in dataset.joints.items() if joint.limits_deg is None}
        rig = rig._widened(free)
        rig = replace(rig, poses=rig._explained(transforms))._widened(free)
        for pose, fitted in rig.poses.items():
            rig._warn_of_limits(pose, fitted)
        return rig

    def _widened(self, free: Collection[str]) -> Rig:
        """The rig with the limits of free joints as its poses and the references give them."""
        limits = widened_limits(self)
        return replace(
            self,
            joints=tuple(
                replace(j, limits=np.array([limits[n] for n in j.angles]).reshape(-1, 2))
                if j.name in free
                else j
                for j in self.joints
            ),
        )

    def _explained(self, transforms: Mapping[str, Bones]) -> dict[str, FittedPose]:
        """The poses that have the root bone, as the rig explains them."""
        poses = {}
        for pose, bones in transforms.items():
            if self.root in bones:
                found = explain(self, bones)
                poses[pose] = FittedPose(bones[self.root], found.angles, found.undetermined)
                if found.undetermined:
                    names = ", ".join(n for n in self.angle_names if n in found.undetermined)
                    LOG.warning("%s: its bones do not determine %s", pose, names)
            else:
                LOG.warning("pose %s is left out: it lacks the root bone %s", pose, self.root)
        return poses

    def angles_of(self, transforms: Bones, model: Model = "full") -> Angles:
        """Angles in rad that bring the bones nearest to given transforms, with the root where it is given.

        Bones that are missing do not count; the root must be there (`explaining.explain`).
        """
        return explain(self, transforms, model).angles

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the rig as an artifact."""
        artifacts.write(path, rig_groups(self), kind="rig", units=rig_units(self), inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Rig:
        """Read a rig; raises `InputError` where it is missing or not a rig."""
        return _from_groups(artifacts.read(path, "rig"))

    def _warn_of_limits(self, pose: str, fitted: FittedPose) -> None:
        for name, angle in fitted.known.items():
            lower, upper = self.limits[name]
            if not lower <= angle <= upper:
                degrees = np.degrees([angle, lower, upper])
                LOG.warning(
                    "%s: %s is %.1f deg, outside its limits of %.1f to %.1f deg", pose, name, *degrees
                )


def outwards(dataset: Dataset) -> list[str]:
    """Names of the joints, each after the joint that carries its parent."""
    return joint_order({name: (joint.parent, joint.child) for name, joint in dataset.joints.items()})


def _fit_joint(joint: Joint, motions: RelativeMotions, near: Array, point: Array) -> JointFit:
    """A joint of the dataset's type, or, if that is "best", of the type that its motions justify."""
    hints = np.array(joint.axis_hints, float)
    if joint.type == "best":
        return fit_best(
            motions.relative, len(joint.angles), hints, near=near, point=point, noise=motions.noise
        )
    return fit_joint(
        motions.relative, len(joint.angles), hints, near=near, joint_type=joint.type, noise=motions.noise
    )


def _warn_of_joint(joint: RigJoint, poses: int) -> None:
    """Warn of what no pose determines of a joint; poses: how many there are to learn from."""
    doubts = joint.knowledge.doubts(joint.angles) if joint.knowledge else []
    if not doubts:
        return
    if not poses:
        why = "there is no example pose besides neutral"
    elif joint.knowledge and not joint.knowledge.poses:
        why = f"no example pose has both {joint.parent} and {joint.child}"
    else:
        why = "it turns too little or too alike in the example poses"
    LOG.warning("joint %s: %s: %s", joint.name, why, "; ".join(doubts))


def joint_point(parent: Surface, child: Surface) -> Array:
    """A point in the gap between two bones, amid where the child comes nearest the parent.

    Parameters
    ----------
    parent, child : Surface
        Bones in mm, apart from one another.

    Returns
    -------
    array (3,)
        Point in mm.
    """
    distances, _, closest = Distance(parent).closest(child.vertices)
    near = distances <= np.quantile(distances, END)
    return (child.vertices[near].mean(axis=0) + closest[near].mean(axis=0)) / 2


def _from_groups(data: Mapping[str, Any]) -> Rig:
    joints = tuple(
        RigJoint(
            name,
            str(g["parent"]),
            str(g["child"]),
            tuple(g["angles"]),
            g["limits"],
            JointFit(
                Axes(g["axes"], tuple(int(i) for i in g["order"])),
                g["centre"],
                Residual(**g["rotation_residual"]),
                Residual(**g["translation_residual"]),
                g["fitted_angles"],
                g.get("offset", np.zeros(3)),
            ),
            knowledge_of_group(g["knowledge"]) if "knowledge" in g else None,
        )
        for name, g in data["joints"].items()
    )
    names = [n for j in joints for n in j.angles]
    poses = {
        pose: FittedPose(
            RigidTransform(g["rotation"], g["translation"]),
            *angles_of_group(names, g["angles"], g.get("assumed")),
        )
        for pose, g in data.get("poses", {}).items()
    }
    surfaces = {b: Surface(g["vertices"], g["triangles"]) for b, g in data["surfaces"].items()}
    return Rig(str(data["root"]), joints, surfaces, poses)
