"""What solvers say of the scanned poses: of the simulated layers, and of the fits to scans."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts, metrics
from handpipe.evaluation import pose_metrics, worst_figures, worst_of
from handpipe.hand import read_frames
from handpipe.stages.files import Files

MODELS = {"m0": "fat"}  # the full model of `simulate_skin` is that of the scenes


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    simulated: Sequence[Path]
    fits: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_poses(inputs: Inputs, outputs: Outputs) -> None:
    """What solvers say of the scanned poses: of the simulated layers, and of the fits to scans."""
    rows: dict[str, dict[str, str | float]] = {}
    for path in inputs.simulated:
        [(frame, layers)] = read_frames(path)
        named = {MODELS.get(name, name): shapes for name, shapes in layers.items()}
        rows.setdefault(frame.name, {"frame": frame.name}).update(worst_figures(named))
    for path in inputs.fits:
        pose = path.stem
        figures = artifacts.read(path, "fat_fit")["figures"]
        rows.setdefault(pose, {"frame": pose}).update(worst_of({"fat_fit": [figures]}))
    artifacts.write_text(outputs.table, json.dumps([*rows.values()], indent=2))
    metrics.write(outputs.metrics, pose_metrics([*rows.values()]))
