"""The bone rig: joint angles to the rigid transforms of all bones, and back (Wang 2019, section 4)."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from handpipe import artifacts
from handpipe.config import Dataset
from handpipe.errors import InputError
from handpipe.mesh.distance import Distance
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.skeleton.angles import Angles, check_angles
from handpipe.skeleton.axes import Axes
from handpipe.skeleton.bodies import moved_as_one
from handpipe.skeleton.joint_types import fit_best
from handpipe.skeleton.joints import JointFit, Model, fit_joint
from handpipe.skeleton.residual import Residual

Array = NDArray[np.float64]
Bones = Mapping[str, RigidTransform]
LOG = logging.getLogger(__name__)


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
    ) -> Rig:
        """Fit every joint to the given poses, then explain all poses.

        transforms: pose -> bone -> transform from neutral in the pose's scanner frame; a pose that lacks a
        bone is left out for that bone's joints; bones that no degree of freedom parts are moved as one.
        surfaces: neutral bones. fit_poses: poses to learn from; the other poses in `transforms` are only
        explained. Raises `InputError` where a joint has no pose to learn from.
        """
        transforms = moved_as_one(dataset, transforms, surfaces)
        joints = []
        learnt = [p for p in fit_poses if p != dataset.neutral]  # neutral is the zero of every joint
        for name in outwards(dataset):
            joint = dataset.joints[name]
            relative = relative_motions(transforms, joint.parent, joint.child, learnt)
            if not relative and joint.angles:
                problem = f"no pose has both {joint.parent} and {joint.child}"
                raise InputError(
                    dataset.name, f"joints.{name}", problem, "Give one more pose or mend registration"
                )
            near = joint_point(surfaces[joint.parent], surfaces[joint.child])
            hints = np.array(joint.axis_hints, float)
            if joint.type == "best":
                point = surfaces[joint.child].vertices.mean(axis=0)
                fit = fit_best(relative, len(joint.angles), hints, near=near, point=point)
            else:
                fit = fit_joint(relative, len(joint.angles), hints, near=near, joint_type=joint.type)
            limits = np.radians(np.array(joint.limits_deg, float)).reshape(-1, 2)
            joints.append(RigJoint(name, joint.parent, joint.child, joint.angles, limits, fit))
        bare = Rig(dataset.root_bone, tuple(joints), {b: surfaces[b] for b in dataset.bones}, {})
        poses = {
            p: FittedPose(t[bare.root], bare.angles_of(t)) for p, t in transforms.items() if bare.root in t
        }
        for pose, fitted in poses.items():
            bare._warn_of_limits(pose, fitted.angles)
        return Rig(bare.root, bare.joints, bare.surfaces, poses)

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
        seen = [j for j in self.joints if j.child in transforms]
        moments = {j.child: _moments(self.surfaces[j.child]) for j in seen}
        start = np.concatenate([self._start(j, transforms) for j in self.joints])

        def residual(values: Array) -> Array:
            angles = dict(zip(self.angle_names, values, strict=True))
            found = self.bone_transforms(angles, transforms[self.root], model)
            return np.concatenate([displacement(found[b], transforms[b], m) for b, m in moments.items()])

        if not seen:
            return dict.fromkeys(self.angle_names, 0.0)
        solution = least_squares(residual, start, xtol=1e-10, ftol=1e-12).x
        return {name: float(v) for name, v in zip(self.angle_names, solution, strict=True)}

    def save(self, path: str | Path, inputs: Sequence[str | Path] = ()) -> None:
        """Write the rig as an artifact."""
        artifacts.write(path, _to_groups(self), kind="rig", units=_units(self), inputs=inputs)

    @staticmethod
    def load(path: str | Path) -> Rig:
        """Read a rig; raises `InputError` where it is missing or not a rig."""
        return _from_groups(artifacts.read(path, "rig"))

    def _start(self, joint: RigJoint, transforms: Bones) -> Array:
        if joint.child not in transforms or joint.parent not in transforms:
            return np.zeros(joint.fit.dof)
        return joint.fit.angles_of([transforms[joint.parent].inverse() @ transforms[joint.child]])[0]

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


def relative_motions(
    transforms: Mapping[str, Bones], parent: str, child: str, poses: Sequence[str]
) -> list[RigidTransform]:
    """Motions of the child with the parent's undone, in the poses that have both."""
    both = [transforms[p] for p in poses if parent in transforms[p] and child in transforms[p]]
    return [t[parent].inverse() @ t[child] for t in both]


def joint_point(parent: Surface, child: Surface) -> Array:
    """A point (3,) in mm in the gap between two bones, amid where the child comes nearest the parent."""
    distances, _, closest = Distance(parent).closest(child.vertices)
    near = distances <= np.quantile(distances, 0.02)
    return (child.vertices[near].mean(axis=0) + closest[near].mean(axis=0)) / 2


def displacement(found: RigidTransform, wanted: RigidTransform, moments: tuple[Array, Array]) -> Array:
    """Numbers (12,) in mm whose squares sum to the mean square of a bone's displacement.

    It takes the bone's vertices from where one transform puts them to where the other does.
    moments: centroid (3,) and square root (3, 3) of the covariance of the bone's vertices.
    """
    centroid, root = moments
    turned = (found.rotation - wanted.rotation) @ root
    return np.concatenate([turned.ravel(), found(centroid) - wanted(centroid)])


def _moments(surface: Surface) -> tuple[Array, Array]:
    centroid = surface.vertices.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(surface.vertices.T, bias=True))
    return centroid, vectors * np.sqrt(np.maximum(values, 0))


def _to_groups(rig: Rig) -> dict[str, Any]:
    return {
        "root": rig.root,
        "joints": {
            j.name: {
                "parent": j.parent,
                "child": j.child,
                "angles": list(j.angles),
                "limits": j.limits,
                "axes": j.fit.axes.directions,
                "order": list(j.fit.axes.order),
                "centre": j.fit.centre,
                "fitted_angles": j.fit.angles,
                "rotation_residual": vars(j.fit.rotation_residual),
                "translation_residual": vars(j.fit.translation_residual),
                **({"offset": j.fit.offset} if j.fit.offset.any() else {}),
            }
            for j in rig.joints
        },
        "surfaces": {b: {"vertices": s.vertices, "triangles": s.triangles} for b, s in rig.surfaces.items()},
        "poses": {
            name: {
                "rotation": p.root.rotation,
                "translation": p.root.translation,
                "angles": np.array([p.angles[n] for n in rig.angle_names]),
            }
            for name, p in rig.poses.items()
        },
    }


def _units(rig: Rig) -> dict[str, str]:
    units = {f"surfaces/{b}/vertices": "mm" for b in rig.surfaces}
    for j in rig.joints:
        units |= {f"joints/{j.name}/{k}": "rad" for k in ("limits", "fitted_angles")}
        units |= {
            f"joints/{j.name}/{k}": "mm" for k in ("centre", *(["offset"] if j.fit.offset.any() else []))
        }
        units[f"joints/{j.name}/rotation_residual/coefficients"] = "rad per product of angles in rad"
        units[f"joints/{j.name}/translation_residual/coefficients"] = "mm per product of angles in rad"
    for pose in rig.poses:
        units |= {f"poses/{pose}/translation": "mm", f"poses/{pose}/angles": "rad"}
    return units


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
