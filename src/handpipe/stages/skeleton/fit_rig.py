"""The kinematic rig from registered bones, its table of errors, and the limits of its angles."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError, artifacts, metrics
from handpipe.core.configuration import Dataset, Role
from handpipe.hand import CarriedTemplate
from handpipe.skeleton.bones import moved_apart, read_registrations, read_surfaces
from handpipe.skeleton.joints import limit_rows
from handpipe.skeleton.registration import without_odd_bones
from handpipe.skeleton.rig import Rig, joint_table
from handpipe.stages.files import Files
from handpipe.stages.truth import bone_errors

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    neutral: Path
    registrations: Sequence[Path]
    truth: Sequence[Path]
    carried: Path | None = None


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    rig: Path
    metrics: Path
    table: Path
    limits: Path


def fit_rig(inputs: Inputs, outputs: Outputs, dataset: Dataset, organs: bool) -> None:
    """The kinematic rig from registered bones, its table of errors, and the limits of its angles."""
    carried = None if inputs.carried is None else CarriedTemplate.load(inputs.carried)
    dataset = dataset if carried is None else carried.in_place(dataset)
    surfaces = read_surfaces(inputs.neutral, "whole")
    registered = dict(zip(dataset.poses, map(read_registrations, inputs.registrations), strict=True))
    doubtful = {(p, b): r.doubt for p, found in registered.items() for b, r in found.items() if r.doubt}
    for (pose, bone), doubt in doubtful.items():
        log.warning("%s: %s is left out: %s", pose, bone, doubt)
    trusted = {p: {b: r for b, r in found.items() if not r.doubt} for p, found in registered.items()}
    fit_poses = dataset.poses_of(Role.neutral, Role.example)
    figures: metrics.Metrics = {} if carried is None else carried.figures()
    with metrics.measured(figures):
        transforms = {p: {b: r.transform for b, r in found.items()} for p, found in trusted.items()}
        transforms, odd = without_odd_bones(dataset, transforms, surfaces, fit_poses)
        apart = moved_apart(dataset, transforms, surfaces)
        rig = Rig.fit(dataset, transforms, surfaces, fit_poses, trusted)
        table = joint_table(rig, dataset, transforms, fit_poses, trusted)
    for (pose, bone), distance in apart.items():
        log.warning(
            "%s: %s lies %.1f mm from where the bones that move as one with it take it: look at them there, "
            "or give their joint angles",
            *(pose, bone, distance),
        )
        figures[f"apart_{pose}_{bone}"] = (distance, "mm")
    guessed = [j.name for j in rig.joints if j.knowledge and j.knowledge.doubts(j.angles)]
    unknown = [(p, n) for p, fitted in rig.poses.items() for n in rig.angle_names if n in fitted.undetermined]
    figures |= {"undetermined_joints": (len(guessed), "1"), "undetermined_angles": (len(unknown), "1")}
    figures |= {f"undetermined_{joint}": (1, "1") for joint in guessed}
    figures |= {f"undetermined_{pose}_{angle}": (1, "1") for pose, angle in unknown}
    figures["doubtful_bones"] = (len(doubtful | odd), "1")
    figures |= {f"doubtful_{pose}_{bone}": (1, "1") for pose, bone in doubtful | odd}
    for pose in dataset.poses:
        if pose not in rig.poses and organs:
            problem = f"its root bone {rig.root} is missing or in doubt"
            raise InputError(dataset.name, f"poses.{pose}", problem, "Mend its seeds, or leave the pose out")
    if dataset.truth is not None:
        centroids = {bone: surface.centroid() for bone, surface in rig.surfaces.items()}
        for role, prefix in ((Role.example, "true_"), (Role.heldout, "true_heldout_")):
            rotations, translations = [], []
            for pose in [p for p in dataset.poses_of(role) if p in rig.poses]:
                found = rig.bone_transforms(rig.poses[pose].angles, rig.poses[pose].root)
                seen = {bone: c for bone, c in centroids.items() if bone in transforms[pose]}
                angles, distances = bone_errors(inputs.truth, pose, found, seen)
                rotations += angles
                translations += distances
            if rotations:
                figures |= metrics.summary(f"{prefix}rotation_error", rotations, "deg")
                figures |= metrics.summary(f"{prefix}translation_error", translations, "mm")
    rig.save(outputs.rig, inputs.all())
    artifacts.write_text(outputs.table, json.dumps(table.rows, indent=2))
    artifacts.write_text(outputs.limits, json.dumps(limit_rows(rig), indent=2))
    metrics.write(outputs.metrics, table.metrics | figures)
