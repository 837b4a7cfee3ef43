"""The full model's skin beside that of its variants, over all scanned poses; their organs; the knuckles."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, Metrics, RigidTransform, Shapes, artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.evaluation import surface_errors
from handpipe.hand import read_frames
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.rig import Rig
from handpipe.stages.baselines.knuckles import knuckles
from handpipe.stages.baselines.variants import PASSIVE, VARIANTS
from handpipe.stages.costs import stage_cost
from handpipe.stages.files import Files
from handpipe.stages.skin_distances import SkinDistances, role_figures, skin_distances
from handpipe.stages.truth import surfaces_in, true_pose
from handpipe.tissues.fat import Skin
from handpipe.tissues.tendons import CENTRELINE
from handpipe.tissues.tendons.fitting import centreline_errors

FULL = {"m0": "m0", "m1": f"m0{PASSIVE}"}  # the full model's skins, and their names here


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads: full model's files, and those of all variants."""

    rig: Path
    skin: Path
    scans: Sequence[Path]
    skins: Sequence[Path]
    passive: Sequence[Path]
    inner: Sequence[Path]
    ablated_skins: Sequence[Path]
    ablated_inner: Sequence[Path]
    truth: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_ablations(inputs: Inputs, outputs: Outputs, dataset: Dataset, costs: Sequence[Path]) -> None:
    """The full model's skin beside that of its variants, over all scanned poses; their organs; the knuckles.

    Figures of skins are those of `role_figures`, by variant; "_passive" is without strains of the fat. With a
    truth, `{variant}_{organ}_{role}_error_mean` is that of the tendons' centrelines and of the muscles'
    surfaces, where the variant changes them, and `{variant}_{joint}_knuckle_error_mean` that of the skin over
    a joint in the pose that bends it most.
    """
    rig, skin = Rig.load(inputs.rig), Skin.load(inputs.skin)
    models: dict[str, dict[str, Shapes]] = {}
    for path in (*inputs.skins, *inputs.passive):
        [(frame, shapes)] = read_frames(path)
        own = {FULL[model]: skin for model, skin in shapes.items() if model in FULL}
        models.setdefault(frame.name, {}).update(own)
    for path in inputs.ablated_skins:
        [(frame, shapes)] = read_frames(path)
        models[frame.name].update(shapes)
    truth = inputs.truth if dataset.truth is not None else ()
    found = skin_distances(rig, skin, models, inputs.scans, truth)
    role_of = {pose: dataset.poses[pose].role.value for pose in models}
    figures, rows = role_figures(found, role_of)
    if truth:
        figures |= _of_organs(inputs, rig, role_of)
        figures |= _of_knuckles(found, rig, skin, dataset)
    metrics.write(outputs.metrics, stage_cost(costs) | figures)
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))


def _of_organs(inputs: Inputs, rig: Rig, role_of: Mapping[str, str]) -> Metrics:
    """Mean errors in mm of tendons and muscles by variant and role: the full model's, and changed ones."""
    errors: dict[str, list[Array]] = {}
    named = [("m0", path) for path in inputs.inner]
    named += [(path.parents[2].name, path) for path in inputs.ablated_inner]
    for variant, path in named:
        [(frame, layers)] = read_frames(path)
        home = rig.poses[frame.name].root.inverse()
        true = true_pose(inputs.truth, frame.name)
        for layer, distances in (
            ("tendons", _tendon_errors(layers, true["tendons"], home)),
            ("muscles", _muscle_errors(layers, true["muscles"], home)),
        ):
            if distances and (variant == "m0" or layer in VARIANTS[variant].loaded):
                name = f"{variant}_{layer}_{role_of[frame.name]}_error_mean"
                errors.setdefault(name, []).extend(distances)
    return {name: (float(np.mean(np.concatenate(all_))), "mm") for name, all_ in errors.items()}


def _tendon_errors(
    layers: Mapping[str, Shapes], true: Mapping[str, Mapping[str, Array]], home: RigidTransform
) -> list[Array]:
    rods = layers.get("tendons", {})
    lines = {f"{n}{CENTRELINE}": home(data["centreline"]) for n, data in true.items()}
    known = {name: line for name, line in lines.items() if name in rods}
    return [e for name, line in known.items() for e in centreline_errors(rods[name].vertices, line)]


def _muscle_errors(
    layers: Mapping[str, Shapes], true: Mapping[str, Mapping[str, Array]], home: RigidTransform
) -> Iterable[Array]:
    there = {name: s.moved(home(s.vertices)) for name, s in surfaces_in(true).items()}
    own = {n: Surface(s.vertices, s.cells) for n, s in layers.get("muscles", {}).items() if n in there}
    return surface_errors(own, there).values()


def _of_knuckles(found: SkinDistances, rig: Rig, skin: Skin, dataset: Dataset) -> Metrics:
    """Mean distance in mm of the skin from the true one over each joint, where it is bent most."""
    figures: Metrics = {}
    for knuckle in knuckles(rig, skin, [*found.to_truth], [t.bones for t in dataset.tendons.values()]):
        near = knuckle.near[found.compared]
        for model, distances in found.to_truth[knuckle.pose].items():
            error = float(np.mean(distances[near]))
            figures[f"{model}_{knuckle.joint}_knuckle_error_mean"] = (error, "mm")
    return figures
