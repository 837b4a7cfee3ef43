"""The bone rig: joint angles to the rigid transforms of all bones, and back (Wang 2019, section 4)."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from handpipe import artifacts
from handpipe.config import Dataset, Joint
from handpipe.errors import InputError
from handpipe.mesh.distance import Distance
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.skeleton.angles import Angles, check_angles
from handpipe.skeleton.axes import Axes
from handpipe.skeleton.bodies import moved_as_one
from handpipe.skeleton.displacement import displacement, displacement_rates, moments
from handpipe.skeleton.joint_types import fit_best
from handpipe.skeleton.joints import JointFit, Model, fit_joint
from handpipe.skeleton.limits import widened_limits
from handpipe.skeleton.motions import BoneNoise, Motions, Registrations, joint_motions
from handpipe.skeleton.residual import Residual
from handpipe.skeleton.rig_groups import rig_groups, rig_units
from handpipe.skeleton.twists import moving_bones

Array = NDArray[np.float64]
Bones = Mapping[str, RigidTransform]
LOG = logging.getLogger(__name__)
ANY_ANGLE = ((-180.0, 180.0),)


@dataclass(frozen=True)
class RigJoint:
    """A fitted joint in the tree: names of its angles, and their limits (dof, 2) in rad."""

    name: str
    parent: str
    child: str
    angles: tuple[str, ...]
    limits: Array
    fit: JointFit


@dataclass(frozen=True)
class FittedPose:
    """A scanned pose as the rig explains it: the root bone's registered transform, and the angles in rad."""

    root: RigidTransform
    angles: Angles


@dataclass(frozen=True)
class Rig:
    """Joints in order from the root outwards; neutral bone surfaces; scanned poses as it explains them."""

    root: str
    joints: tuple[RigJoint, ...]
    surfaces: dict[str, Surface]
    poses: dict[str, FittedPose]

    @staticmethod
    def fit(
        dataset: Dataset,
        transforms: Mapping[str, Bones],
        surfaces: Mapping[str, Surface],
        fit_poses: Sequence[str],
        registrations: Registrations | None = None,
    ) -> Rig:
        """Fit every joint to the given poses, then explain all poses.

        transforms: pose -> bone -> transform from neutral in the pose's scanner frame; a pose that lacks a
        bone is left out for that bone's joints; bones that no degree of freedom parts are moved as one.
        surfaces: neutral bones. fit_poses: poses to learn from; the other poses in `transforms` are only
        explained. registrations: how well each transform is known; with them, motions count accordingly, and
        the dataset's hints where motions tell little. Limits that the dataset does not state are those of
        `limits.widened_limits`. Raises `InputError` where a joint has no pose to learn from.
        """
        noise = None if registrations is None else BoneNoise(dataset, registrations, surfaces)
        transforms = moved_as_one(dataset, transforms, surfaces)
        joints = []
        learnt = [p for p in fit_poses if p != dataset.neutral]  # neutral is the zero of every joint
        for name in outwards(dataset):
            joint = dataset.joints[name]
            near = joint_point(surfaces[joint.parent], surfaces[joint.child])
            motions = joint_motions(transforms, joint.parent, joint.child, learnt, near, noise)
            if not motions.poses and joint.angles:
                problem = f"no pose has both {joint.parent} and {joint.child}"
                raise InputError(
                    dataset.name, f"joints.{name}", problem, "Give one more pose or mend registration"
                )
            fit = _fit_joint(joint, motions, near, surfaces[joint.child].vertices.mean(axis=0))
            limits = np.radians(np.array(joint.limits_deg or ANY_ANGLE * len(joint.angles), float))
            joints.append(RigJoint(name, joint.parent, joint.child, joint.angles, limits.reshape(-1, 2), fit))
        bare = Rig(dataset.root_bone, tuple(joints), {b: surfaces[b] for b in dataset.bones}, {})
        rig = replace(bare, poses=bare._explained(transforms))
        free = {name for name, joint in dataset.joints.items() if joint.limits_deg is None}
        rig = replace(rig, joints=tuple(_widened(j, rig) if j.name in free else j for j in rig.joints))
        for pose, fitted in rig.poses.items():
            rig._warn_of_limits(pose, fitted.angles)
        return rig

    def _explained(self, transforms: Mapping[str, Bones]) -> dict[str, FittedPose]:
        """The poses that have the root bone, as the rig explains them."""
        poses = {}
        for pose, bones in transforms.items():
            if self.root in bones:
                poses[pose] = FittedPose(bones[self.root], self.angles_of(bones))
            else:
                LOG.warning("%s is left out: it lacks the root bone %s", pose, self.root)
        return poses

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

    def angles_of(self, transforms: Bones, model: Model = "full") -> Angles:
        """Angles in rad that bring the bones nearest to given transforms, with the root where it is given.

        The distance is the mean square displacement of all bones' vertices, which weighs rotations and
        translations without further parameters. Bones that are missing do not count; the root must be there.
        """
        wanted = {j.child: transforms[j.child] for j in self.joints if j.child in transforms}
        if not wanted or not self.angle_names:
            return dict.fromkeys(self.angle_names, 0.0)
        of_bones = {b: moments(self.surfaces[b]) for b in wanted}

        def named(values: Array) -> Angles:
            return dict(zip(self.angle_names, values, strict=True))

        def residual(values: Array) -> Array:
            found = self.bone_transforms(named(values), transforms[self.root], model)
            return np.concatenate([displacement(found[b], t, of_bones[b]) for b, t in wanted.items()])

        def jacobian(values: Array) -> Array:
            found = moving_bones(self, named(values), transforms[self.root], model)
            return np.vstack([displacement_rates(found[b], of_bones[b]) for b in wanted])

        solutions = [
            least_squares(residual, start, jac=jacobian, xtol=1e-14, ftol=1e-14, gtol=1e-12)
            for start in self._starts(transforms)
        ]
        best = min(solutions, key=lambda solution: solution.cost)
        return {name: float(v) for name, v in zip(self.angle_names, best.x, strict=True)}

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the rig as an artifact."""
        artifacts.write(path, rig_groups(self), kind="rig", units=rig_units(self), inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Rig:
        """Read a rig; raises `InputError` where it is missing or not a rig."""
        return _from_groups(artifacts.read(path, "rig"))

    def _starts(self, transforms: Bones) -> list[Array]:
        """Angles (n,) to start from: those of the motions seen, zero where nothing that a joint carries is.

        Over a missing bone two joints share a motion, and a wrong start bends one of them backwards: there
        the middle and the end of the seen range are tried, too.
        """
        carried = {j.child: j.child in transforms for j in self.joints}
        for joint in reversed(self.joints):
            if joint.parent != self.root:
                carried[joint.parent] |= carried[joint.child]
        starts, shared = [], False
        for level in (0.0, 0.5, 1.0):
            parts = []
            for joint in self.joints:
                if joint.child in transforms and joint.parent in transforms:
                    relative = transforms[joint.parent].inverse() @ transforms[joint.child]
                    parts.append(joint.fit.angles_of([relative])[0])
                else:
                    shared = shared or (carried[joint.child] and joint.fit.dof > 0)
                    ends = np.vstack([np.zeros((1, joint.fit.dof)), joint.fit.angles]).max(axis=0)
                    parts.append(level * ends if carried[joint.child] else np.zeros(joint.fit.dof))
            starts.append(np.concatenate(parts))
        return starts if shared else starts[:1]

    def _warn_of_limits(self, pose: str, angles: Angles) -> None:
        for name, (lower, upper) in self.limits.items():
            if not lower <= angles[name] <= upper:
                degrees = np.degrees([angles[name], lower, upper])
                LOG.warning(
                    "%s: %s is %.1f deg, outside its limits of %.1f to %.1f deg", pose, name, *degrees
                )


def outwards(dataset: Dataset) -> list[str]:
    """Names of the joints, each after the joint that carries its parent."""
    reached, order, left = {dataset.root_bone}, [], dict(dataset.joints)
    while left:
        for name in [n for n, j in left.items() if j.parent in reached]:
            reached.add(left.pop(name).child)
            order.append(name)
    return order


def _fit_joint(joint: Joint, motions: Motions, near: Array, point: Array) -> JointFit:
    """A joint of the dataset's type; of the type that its motions earn, where the dataset says so."""
    hints = np.array(joint.axis_hints, float)
    if joint.type == "best":
        return fit_best(
            motions.relative, len(joint.angles), hints, near=near, point=point, noise=motions.noise
        )
    return fit_joint(
        motions.relative, len(joint.angles), hints, near=near, joint_type=joint.type, noise=motions.noise
    )


def _widened(joint: RigJoint, rig: Rig) -> RigJoint:
    limits = widened_limits(rig)
    return replace(joint, limits=np.array([limits[n] for n in joint.angles]).reshape(-1, 2))


def joint_point(parent: Surface, child: Surface) -> Array:
    """A point (3,) in mm in the gap between two bones, amid where the child comes nearest the parent."""
    distances, _, closest = Distance(parent).closest(child.vertices)
    near = distances <= np.quantile(distances, 0.02)
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
        )
        for name, g in data["joints"].items()
    )
    names = [n for j in joints for n in j.angles]
    poses = {
        pose: FittedPose(
            RigidTransform(g["rotation"], g["translation"]),
            {n: float(a) for n, a in zip(names, g["angles"], strict=True)},
        )
        for pose, g in data.get("poses", {}).items()
    }
    surfaces = {b: Surface(g["vertices"], g["triangles"]) for b, g in data["surfaces"].items()}
    return Rig(str(data["root"]), joints, surfaces, poses)
