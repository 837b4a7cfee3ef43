"""How well the rig explains registered bones, joint by joint (Wang 2019, Table 1), also in new poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, Metrics, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.bodies import moved_as_one
from handpipe.skeleton.joints.joint_tree import Bones, RigJoint
from handpipe.skeleton.joints.joints import JointFit, Model, fit_joint
from handpipe.skeleton.rig.motions import BoneNoise, Registrations, joint_motions
from handpipe.skeleton.rig.rig import Rig, joint_point

MODELS: tuple[tuple[Model, str], ...] = (("full", "FM"), ("partial", "PM"))
PREFIXES: tuple[tuple[Model, str], ...] = (("full", ""), ("partial", "partial_"))
Row = dict[str, str | float]
Columns = dict[str, Array]

# Metric -> column and unit. Places: of the corners of the child's box, which show turns about all axes alike.
NAMES = {f"{prefix}place_error": (f"{prefix}FM_p", "mm") for prefix in ("", "loo_", "heldout_")} | {
    f"{prefix}{model}{kind}_error": (f"{prefix}{short}_{letter}", unit)
    for prefix in ("", "loo_", "heldout_")
    for short, model in (("FM", ""), ("PM", "partial_"))
    for letter, kind, unit in (("R", "rotation", "deg"), ("x", "translation", "mm"))
}
# Averages of Table 1 of Wang 2019, real hand, all twelve poses fitted.
PUBLISHED: Metrics = {
    "paper_rotation_error_mean": (1.84, "deg"),
    "paper_translation_error_mean": (0.45, "mm"),
    "paper_partial_rotation_error_mean": (2.45, "deg"),
    "paper_partial_translation_error_mean": (0.69, "mm"),
}


@dataclass(frozen=True)
class JointTable:
    """Errors of a rig by joint, and their means.

    Attributes
    ----------
    rows : list of Row
        One row a joint: `joint`, `type`, `poses` that it was fitted to, and mean errors by column, rotations
        (_R) in deg, translations (_x) in mm. Columns FM_ and PM_ are the full and the partial model on the
        fitted poses, with prefix loo_ on each of them left out of the fit in turn, with prefix heldout_ on
        poses that no fit saw (absent if there are none).
    metrics : Metrics
        The same by joint, the means over joints and poses, those of the paper, and absolute errors of the
        bones.
    """

    rows: list[Row]
    metrics: Metrics


def joint_table(
    rig: Rig,
    dataset: Dataset,
    transforms: Mapping[str, Bones],
    fit_poses: Sequence[str],
    registrations: Registrations | None = None,
) -> JointTable:
    """Errors of a rig joint by joint, on fitted and on held-out poses.

    Rotation errors are angles of R_found^T R_true of the child relative to its parent. Translation errors are
    distances of the child's centroid from its true place. Place errors, of the full model, are root mean
    square distances of the corners of the child's box. A ball joint follows every rotation: it has no
    rotation errors. Neutral, without error, does not count. A joint that no pose shows has no errors.

    Parameters
    ----------
    rig : Rig
        Rig that was fitted to `fit_poses`.
    dataset : Dataset
        Dataset with the joints.
    transforms : mapping of str to mapping of str to RigidTransform
        Registered transforms from neutral by pose and bone. Poses other than `fit_poses` and neutral are held
        out.
    fit_poses : sequence of str
        Poses that the rig was fitted to.
    registrations : mapping of str to mapping of str to Registration, optional
        Registrations with which the rig was fitted, by pose and bone.

    Returns
    -------
    JointTable
        Rows by joint, and their means.
    """
    noise = None if registrations is None else BoneNoise(dataset, registrations, rig.surfaces)
    transforms = moved_as_one(dataset, transforms, rig.surfaces)
    fitted = [p for p in fit_poses if p != dataset.neutral]
    heldout = [p for p in transforms if p not in fit_poses and p != dataset.neutral]
    moving = [joint for joint in rig.joints if joint.angles]  # bones that move as one have nothing to explain
    columns = {j.name: _columns(j, rig, dataset, transforms, fitted, heldout, noise) for j in moving}
    rows: list[Row] = [
        {
            "joint": joint.name,
            "type": joint.fit.type,
            "poses": float(len(joint.fit.angles)),
            **_deviations(joint),
            **{name: float(errors.mean()) for name, errors in columns[joint.name].items()},
        }
        for joint in moving
    ]
    metrics = PUBLISHED | _by_joint(columns) | _means(list(columns.values()))
    for kind, poses in (("", fitted), ("heldout_", heldout)):
        metrics |= _bone_errors(kind, rig, {p: transforms[p] for p in poses if rig.root in transforms[p]})
    return JointTable(rows, metrics)


def _columns(
    joint: RigJoint,
    rig: Rig,
    dataset: Dataset,
    transforms: Mapping[str, Bones],
    fitted: Sequence[str],
    heldout: Sequence[str],
    noise: BoneNoise | None,
) -> Columns:
    near = joint_point(rig.surfaces[joint.parent], rig.surfaces[joint.child])
    seen = joint_motions(transforms, joint.parent, joint.child, fitted, near, noise)
    unseen = joint_motions(transforms, joint.parent, joint.child, heldout, near)
    points = ErrorPoints.measure(rig.surfaces[joint.child])
    out = _errors("", joint.fit, seen.relative, points)
    hints = np.array(dataset.joints[joint.name].axis_hints, float)
    left_out = []
    for rest, left in seen.leave_one_out():
        fit = fit_joint(
            rest.relative, joint.fit.dof, hints, near=near, joint_type=joint.fit.type, noise=rest.noise
        )
        left_out.append(_errors("loo_", fit, [left], points))
    if left_out:
        out |= {name: np.concatenate([errors[name] for errors in left_out]) for name in left_out[0]}
    return out | _errors("heldout_", joint.fit, unseen.relative, points)


@dataclass(frozen=True)
class ErrorPoints:
    """Points of a neutral bone at which errors are measured: its centroid (3,), its box's corners (8, 3)."""

    centroid: Array
    corners: Array

    @staticmethod
    def measure(surface: Surface) -> ErrorPoints:
        """Of the box along the principal axes of a bone's vertices."""
        centroid = surface.vertices.mean(axis=0)
        _, axes = np.linalg.eigh(np.cov(surface.vertices.T))
        along = (surface.vertices - centroid) @ axes
        ends = np.array([along.min(axis=0), along.max(axis=0)])
        corners = np.stack(np.meshgrid(*ends.T, indexing="ij"), axis=-1).reshape(-1, 3)
        return ErrorPoints(centroid, centroid + corners @ axes.T)


def _errors(prefix: str, fit: JointFit, relative: Sequence[RigidTransform], points: ErrorPoints) -> Columns:
    columns: Columns = {}
    for model, short in MODELS if relative else ():
        rotation, translation = fit.errors(relative, points.centroid, model)
        if fit.type != "ball":
            columns[f"{prefix}{short}_R"] = np.degrees(rotation)
        columns[f"{prefix}{short}_x"] = translation
    if relative:
        columns[f"{prefix}FM_p"] = fit.place_errors(relative, points.corners)
    return columns


def _deviations(joint: RigJoint) -> Row:
    """How far the joint's axes (deg) and its centre (mm) may be off, of a joint that was fitted."""
    known = joint.knowledge
    if known is None:
        return {}
    axes = {
        f"axis_deviation_{n}": float(np.degrees(d)) for n, d in zip(joint.angles, known.axes, strict=True)
    }
    return {**axes, "centre_deviation": known.centre, "undetermined": "; ".join(known.doubts(joint.angles))}


def _by_joint(columns: Mapping[str, Columns]) -> Metrics:
    """Means of each joint: rotation_error_{joint}, translation_error_{joint}, prefixed as in `_means`."""
    metrics: Metrics = {}
    for joint, found in columns.items():
        for name, (column, unit) in NAMES.items():
            if column in found:
                metrics[f"{name}_{joint}"] = (float(found[column].mean()), unit)
    return metrics


def _means(columns: Sequence[Columns]) -> Metrics:
    """rotation_error_mean and translation_error_mean, after loo_ or heldout_, and partial_."""
    metrics: Metrics = {}
    for name, (column, unit) in NAMES.items():
        found = [c[column] for c in columns if column in c]
        if found:
            metrics[f"{name}_mean"] = (float(np.concatenate(found).mean()), unit)
    return metrics


def _bone_errors(prefix: str, rig: Rig, transforms: Mapping[str, Bones]) -> Metrics:
    """Mean and largest distance of bone vertices from the registered bones, with each model's best angles."""
    metrics: Metrics = {}
    for model, name in PREFIXES if transforms else ():
        errors = []
        for registered in transforms.values():
            found = rig.bone_transforms(rig.angles_of(registered, model), registered[rig.root], model)
            for bone in set(registered) & set(found) - {rig.root}:
                points = rig.surfaces[bone].vertices
                errors.append(np.linalg.norm(found[bone](points) - registered[bone](points), axis=1))
        if not errors:
            continue
        every = np.concatenate(errors)
        metrics[f"{prefix}{name}bone_error_mean"] = (float(every.mean()), "mm")
        metrics[f"{prefix}{name}bone_error_max"] = (float(every.max()), "mm")
    return metrics
