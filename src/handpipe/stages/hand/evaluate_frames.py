"""Figures of a scene's frames: distance to what was seen, collisions, solvers, continuity, failures."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset, Role, Scene
from handpipe.evaluation import Row, figure_metrics, figure_names, with_figures
from handpipe.hand import Continuity, SimulatedFrame, Step, continuity_metrics, read_simulated
from handpipe.skeleton.drivers import read_frames
from handpipe.skeleton.posing import PoseValidity, validity_table
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    frames: Path
    motion: Path | None
    equilibria: Sequence[Path]
    chunks: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    metrics: Path
    table: Path


def evaluate_frames(inputs: Inputs, outputs: Outputs, dataset: Dataset, scene: Scene) -> None:
    """Figures of a scene's frames: distance to what was seen, collisions, solvers, continuity, failures."""
    rig = Rig.load(inputs.rig)
    frames = read_frames(inputs.frames, rig, hand=dataset.hand, bones=scene.bones)
    seen = [p for p in dataset.poses_of(Role.neutral, Role.example) if p in rig.poses]
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        table, found = validity_table(PoseValidity(rig, seen), frames)
        rows: list[Row] = [*table]
        plain, steps = list(rows[0]), _Steps(rig, list(frames))
        for chunk in inputs.chunks:
            simulated, failures = read_simulated(chunk)
            rows = with_figures(rows, simulated, failures)
            steps.follow(simulated)
        found |= figure_metrics(rows, figure_names(rows, plain)) | continuity_metrics(steps.found.values())
        motion, others = _figures_of_frames([inputs.motion]), _figures_of_frames(inputs.equilibria)
        found |= _other_equilibria(others.values())
        for further in (motion, others, steps.found):
            rows = [{**row, **further.get(_frame(row), {})} for row in rows]
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))
    metrics.write(outputs.metrics, found | figures)


class _Steps:
    """The steps of a scene by frame; none after a frame that is missing."""

    def __init__(self, rig: Rig, order: Sequence[str]) -> None:
        self.found: dict[str, Step] = {}
        self._continuity, self._number = Continuity(rig.surfaces), {name: i for i, name in enumerate(order)}
        self._last = -1

    def follow(self, frames: Sequence[SimulatedFrame]) -> None:
        for frame, layers in frames:
            if self._number[frame.name] != self._last + 1:
                self._continuity.cut()
            self._last = self._number[frame.name]
            self.found[frame.name] = self._continuity.step(frame, layers)


def _figures_of_frames(paths: Iterable[Path | None]) -> dict[str, Row]:
    """Figures of the frames of a motion, or of their other equilibria, by name."""
    tables = [json.loads(path.read_text(encoding="utf-8"))["frames"] for path in paths if path is not None]
    return {_frame(row): row for rows in tables for row in rows}


def _other_equilibria(rows: Collection[Row]) -> metrics.Metrics:
    """How many frames have other equilibria, and how far their skins are away; empty without rows."""
    if not rows:
        return {}
    many = float(sum(float(row["other_equilibria"]) > 0 for row in rows))
    farthest = max(float(row.get("other_skin_max", 0.0)) for row in rows)
    return {"frames_with_other_equilibria": (many, "frames"), "other_skin_max": (farthest, "mm")}


def _frame(row: Row) -> str:
    return str(row["frame"])
