"""How well the rig explains registered bones, joint by joint (Wang 2019, Table 1), also in new poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handpipe.config import Dataset
from handpipe.mesh.rigid import RigidTransform
from handpipe.metrics import Metrics
from handpipe.skeleton.bodies import moved_as_one
from handpipe.skeleton.joints import JointFit, Model, fit_joint, leave_one_out
from handpipe.skeleton.rig import Bones, Rig, RigJoint, relative_motions

Array = NDArray[np.float64]
MODELS: tuple[tuple[Model, str], ...] = (("full", "FM"), ("partial", "PM"))
PREFIXES: tuple[tuple[Model, str], ...] = (("full", ""), ("partial", "partial_"))
Row = dict[str, str | float]
Columns = dict[str, Array]


@dataclass(frozen=True)
class JointTable:
    """rows: one a joint; `joint`, and mean errors by column, rotations (_R) in deg, translations (_x) in mm.

    Columns FM_ and PM_ are the full and the partial model on the fitted poses, with prefix loo_ on each of
    them left out of the fit in turn, with prefix heldout_ on poses that no fit saw (absent if there are
    none). metrics: the means over joints and poses, and absolute errors of the bones.
    """

    rows: list[Row]
    metrics: Metrics


def joint_table(
    rig: Rig, dataset: Dataset, transforms: Mapping[str, Bones], fit_poses: Sequence[str]
) -> JointTable:
    """Errors of a rig fitted to `fit_poses`; the other poses of `transforms`, but neutral, are held out.

    Rotation errors are angles of R_found^T R_true of the child relative to its parent; translation errors
    are distances of the child's centroid from its true place. Neutral, without error, does not count.
    """
    transforms = moved_as_one(dataset, transforms, rig.surfaces)
    fitted = [p for p in fit_poses if p != dataset.neutral]
    heldout = [p for p in transforms if p not in fit_poses and p != dataset.neutral]
    moving = [joint for joint in rig.joints if joint.angles]  # bones that move as one have nothing to explain
    columns = [_columns(joint, rig, dataset, transforms, fitted, heldout) for joint in moving]
    rows: list[Row] = [
        {"joint": joint.name, **{name: float(errors.mean()) for name, errors in column.items()}}
        for joint, column in zip(moving, columns, strict=True)
    ]
    metrics = _means(columns)
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
) -> Columns:
    seen = relative_motions(transforms, joint.parent, joint.child, fitted)
    unseen = relative_motions(transforms, joint.parent, joint.child, heldout)
    centroid = rig.surfaces[joint.child].vertices.mean(axis=0)
    out = _errors("", joint.fit, seen, centroid)
    hints = np.array(dataset.joints[joint.name].axis_hints, float)
    left_out = [
        _errors(
            "loo_",
            fit_joint(rest, joint.fit.dof, hints, near=joint.fit.centre, joint_type=joint.fit.type),
            [left],
            centroid,
        )
        for rest, left in leave_one_out(seen)
    ]
    if left_out:
        out |= {name: np.concatenate([errors[name] for errors in left_out]) for name in left_out[0]}
    return out | _errors("heldout_", joint.fit, unseen, centroid)


def _errors(prefix: str, fit: JointFit, relative: Sequence[RigidTransform], point: Array) -> Columns:
    columns: Columns = {}
    for model, short in MODELS if relative else ():
        rotation, translation = fit.errors(relative, point, model)
        columns[f"{prefix}{short}_R"] = np.degrees(rotation)
        columns[f"{prefix}{short}_x"] = translation
    return columns


def _means(columns: Sequence[Columns]) -> Metrics:
    """rotation_error_mean and translation_error_mean, after loo_ or heldout_, and partial_."""
    metrics: Metrics = {}
    for prefix in ("", "loo_", "heldout_"):
        for short, model in (("FM", ""), ("PM", "partial_")):
            for letter, name, unit in (("R", "rotation", "deg"), ("x", "translation", "mm")):
                found = [c[f"{prefix}{short}_{letter}"] for c in columns if f"{prefix}{short}_{letter}" in c]
                if found:
                    value = float(np.concatenate(found).mean())
                    metrics[f"{prefix}{model}{name}_error_mean"] = (value, unit)
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
        every = np.concatenate(errors)
        metrics[f"{prefix}{name}bone_error_mean"] = (float(every.mean()), "mm")
        metrics[f"{prefix}{name}bone_error_max"] = (float(every.max()), "mm")
    return metrics
