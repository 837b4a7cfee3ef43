"""Simulated muscles against truth; penetration after separation; inverted tets."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.evaluation import deepest, error_rows, surface_errors
from handpipe.fem.elements import plasticity
from handpipe.hand import read_frames
from handpipe.mesh.surfaces import Surface, each_moved
from handpipe.mesh.tets import TetMesh
from handpipe.skeleton.bones import read_registration
from handpipe.skeleton.rig import Rig
from handpipe.stages.costs import contact_figures, stage_cost
from handpipe.stages.files import Files
from handpipe.stages.muscles.muscle_files import read_guesses
from handpipe.stages.truth import surfaces_in, true_pose
from handpipe.tissues.muscles import Muscle
from handpipe.tissues.muscles.separation import load_surfaces

PREFIXES = {"example": "", "heldout": "heldout_"}


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    templates: Path
    muscles: Sequence[Path]
    separated: Sequence[Path]
    inner: Sequence[Path]
    registrations: Sequence[Path]
    truth: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_muscles(inputs: Inputs, outputs: Outputs, dataset: Dataset, costs: Sequence[Path]) -> None:
    """Simulated muscles against truth; penetration after separation; inverted tets."""
    rig = Rig.load(inputs.rig)
    muscles = {m.name: m for m in map(Muscle.load, inputs.muscles)}
    figures = stage_cost(costs)
    attached = {name: muscle.body.attached_vertices for name, muscle in muscles.items()}
    depths = []
    for path, registration in zip(inputs.separated, inputs.registrations, strict=True):
        bones = each_moved(rig.surfaces, read_registration(registration))
        depths.append(deepest(load_surfaces(path), attached, bones.values()))
    if depths:
        figures["penetration_max"] = (max(depths), "mm")
    eigenvalues = np.concatenate(
        [plasticity.eigenvalues(plasticity.exp(m.logs.reshape(-1, 6))) for m in muscles.values()]
    )
    figures["strain_eigenvalue_min"] = (float(eigenvalues.min()), "1")
    figures["strain_eigenvalue_max"] = (float(eigenvalues.max()), "1")

    errors: dict[str, dict[str, np.ndarray]] = {}
    inverted, volumes, contacts = 0, [], []
    for path in inputs.inner:
        [(frame, layers)] = read_frames(path)
        shapes = layers["muscles"]
        contacts.append(shapes[next(iter(muscles))].figures)
        for name in muscles:
            tets = shapes[f"{name}_mesh"]
            ratios = TetMesh(tets.vertices, tets.cells).volumes()
            inverted += int((ratios <= 0).sum())
            volumes.append(abs(ratios.sum() / TetMesh(tets.rest, tets.cells).volumes().sum() - 1) * 100)
        if dataset.truth is not None:
            home = rig.poses[frame.name].root.inverse()
            simulated = {name: Surface(shapes[name].vertices, shapes[name].cells) for name in muscles}
            true = surfaces_in(true_pose(inputs.truth, frame.name)["muscles"])
            there = {name: surface.moved(home(surface.vertices)) for name, surface in true.items()}
            errors[frame.name] = surface_errors(simulated, there)
    figures["inverted_tets"] = (inverted, "1")
    if contacts:
        figures |= contact_figures(contacts)
        figures["volume_change_max"] = (float(max(volumes)), "%")
    for role, prefix in PREFIXES.items():
        known = [d for pose, e in errors.items() if dataset.poses[pose].role == role for d in e.values()]
        if known:
            figures |= metrics.summary(f"{prefix}surface_error", np.concatenate(known), "mm")

    if dataset.truth is not None:
        true = surfaces_in(true_pose(inputs.truth, dataset.neutral)["muscles"])
        placed = {n: g.surface for n, g in read_guesses(inputs.templates, dataset.muscles).items()}
        fitted = {name: muscle.body.surface for name, muscle in muscles.items()}
        for surfaces, name in ((placed, "template_error"), (fitted, "neutral_error")):
            found = surface_errors(surfaces, true)
            figures |= metrics.summary(name, np.concatenate([*found.values()]), "mm")
        errors = {dataset.neutral: found} | errors
    roles = {pose: dataset.poses[pose].role.value for pose in errors}
    artifacts.write_text(outputs.table, json.dumps(error_rows(errors, roles), indent=2))
    metrics.write(outputs.metrics, figures)
