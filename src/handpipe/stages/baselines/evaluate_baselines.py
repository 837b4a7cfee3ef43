"""The full model's skin beside that of simpler models, over all scanned poses."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import Metrics, artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.hand import read_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.costs import contact_figures, stage_cost
from handpipe.stages.files import Files
from handpipe.stages.skin_distances import role_figures, skin_distances
from handpipe.tissues.fat import Skin

SIMULATED = ("m1", "m2", "m3")  # the models besides the full one, of which the best is named
HELD_OUT = "heldout"


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    skin: Path
    scans: Sequence[Path]
    skins: Sequence[Path]
    passive: Sequence[Path]
    baselines: Sequence[Path]
    truth: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_baselines(inputs: Inputs, outputs: Outputs, dataset: Dataset, costs: Sequence[Path]) -> None:
    """The full model's skin beside that of simpler models, over all scanned poses.

    Figures are `{model}_{role}_error_{statistic}` to scans and `{model}_true_{role}_error_{statistic}` to the
    true skin, in mm: the mean over the role's poses of the means, and the largest. `m0_over_best_heldout` is
    the full model's mean over that of the best other simulated model, in %. `{model}_contact_…` and
    `{model}_overlap_max` are of the skins of the models that are simulated, over all scanned poses.
    """
    models = {f.name: dict(shapes) for path in inputs.skins for f, shapes in read_frames(path)}
    for path in (*inputs.passive, *inputs.baselines):
        for frame, shapes in read_frames(path):
            models[frame.name].update(shapes)
    truth = inputs.truth if dataset.truth is not None else ()
    found = skin_distances(Rig.load(inputs.rig), Skin.load(inputs.skin), models, inputs.scans, truth)
    role_of = {pose: dataset.poses[pose].role.value for pose in models}
    by_role, rows = role_figures(found, role_of)
    figures = stage_cost(costs) | by_role
    for model in SIMULATED if models else ():
        skins = [shapes[model]["skin"].figures for shapes in models.values()]
        figures |= contact_figures(skins, f"{model}_")
        figures[f"{model}_overlap_max"] = (max(f["skin_overlap"] for f in skins), "mm")
    for kind in ("", "true_"):
        figures |= _over_best(kind, by_role)
    metrics.write(outputs.metrics, figures)
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))


def _over_best(kind: str, figures: Metrics) -> Metrics:
    """The full model's mean over the least of the other simulated models'; nothing without held-out poses."""
    means = {
        model: figures[name][0]
        for model in ("m0", *SIMULATED)
        if (name := f"{model}_{kind}{HELD_OUT}_error_mean") in figures
    }
    best = min((means[model] for model in SIMULATED if model in means), default=0.0)
    return {f"m0_over_best_{kind}{HELD_OUT}": (100 * means["m0"] / best, "%")} if best > 0 else {}
