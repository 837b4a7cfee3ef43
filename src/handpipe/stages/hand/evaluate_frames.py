"""Figures of a scene's frames: whether inside what was seen, collisions of bones, solvers, failures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset, Role, Scene
from handpipe.evaluation import Row, figure_metrics, figure_names, with_figures
from handpipe.hand import read_simulated
from handpipe.skeleton.drivers import read_frames
from handpipe.skeleton.posing import PoseValidity, validity_table
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    frames: Path
    chunks: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_frames(inputs: Inputs, outputs: Outputs, dataset: Dataset, scene: Scene) -> None:
    """Figures of a scene's frames: whether inside what was seen, collisions of bones, solvers, failures."""
    rig = Rig.load(inputs.rig)
    frames = read_frames(inputs.frames, rig, hand=dataset.hand, bones=scene.bones)
    seen = [p for p in dataset.poses_of(Role.neutral, Role.example) if p in rig.poses]
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        table, found = validity_table(PoseValidity(rig, seen), frames)
        rows: list[Row] = [*table]
        plain = list(rows[0])
        for chunk in inputs.chunks:
            rows = with_figures(rows, *read_simulated(chunk))
        found |= figure_metrics(rows, figure_names(rows, plain))
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))
    metrics.write(outputs.metrics, found | figures)
