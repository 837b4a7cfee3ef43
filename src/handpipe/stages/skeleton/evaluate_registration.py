"""Registered transforms against truth, with their uncertainties and what is in doubt or missing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.skeleton.bones import read_registrations, read_surfaces
from handpipe.skeleton.registration import registration_figures, registration_rows
from handpipe.stages.costs import stage_cost
from handpipe.stages.files import Files
from handpipe.stages.truth import bone_errors


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    neutral: Path
    registrations: Sequence[Path]
    truth: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_registration(inputs: Inputs, outputs: Outputs, dataset: Dataset, costs: Sequence[Path]) -> None:
    """Registered transforms against truth, with their uncertainties and what is in doubt or missing."""
    figures = stage_cost(costs)
    centroids = {b: s.centroid() for b, s in read_surfaces(inputs.neutral, "whole").items()}
    rows, missing = [], []
    for pose, path in zip(dataset.poses, inputs.registrations, strict=True):
        if pose == dataset.neutral:
            continue
        found = read_registrations(path)
        missing += [(pose, bone) for bone in dataset.bones if bone not in found]
        errors = {}
        if dataset.truth is not None:
            transforms = {bone: r.transform for bone, r in found.items()}
            here = {bone: centroids[bone] for bone in found}
            errors = dict(
                zip(found, zip(*bone_errors(inputs.truth, pose, transforms, here), strict=True), strict=True)
            )
        rows += registration_rows(pose, found, errors)
    metrics.write(outputs.metrics, figures | registration_figures(rows, missing))
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))
