"""Weights (L0) and correctives (L1) from the frames of a scene, with their errors on left-out frames."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Metrics, artifacts, metrics
from handpipe.hand import StoredFrames, tissue
from handpipe.levels import LearnedHand, learn, write_portable
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    chunks: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    levels: Path
    portable: Path
    metrics: Path
    table: Path


def learn_levels(inputs: Inputs, outputs: Outputs) -> None:
    """Weights (L0) and correctives (L1) from the frames of a scene, with their errors on left-out frames."""
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        frames, source = StoredFrames(inputs.chunks), Path(inputs.chunks[0]).parent
        hand = learn(frames, Rig.load(inputs.rig), source)
    hand.save(outputs.levels, inputs.all())
    write_portable(outputs.portable, hand)
    rows = [
        {"layer": layer, "body": name, "level": level, "mean": errors.mean, "largest": errors.largest}
        for (layer, name), body in hand.bodies.items()
        for level, errors in body.errors.items()
    ]
    artifacts.write_text(outputs.table, json.dumps(rows, indent=2))
    found: Metrics = {"frames": (float(len(frames)), "frames")}
    metrics.write(outputs.metrics, found | errors_by_tissue(hand) | figures)


def errors_by_tissue(hand: LearnedHand) -> Metrics:
    """Mean over the vertices, and largest, of the errors in mm of left-out frames, by level and tissue."""
    parts: dict[str, list[tuple[float, float, int]]] = {}
    for (layer, name), body in hand.bodies.items():
        for level, errors in body.errors.items():
            key = f"{level.lower()}_{tissue(layer, name)}"
            parts.setdefault(key, []).append((errors.mean, errors.largest, len(body.rest)))
    found: Metrics = {}
    for key, rows in parts.items():
        means, largest, counts = (np.array(column) for column in zip(*rows, strict=True))
        found[f"{key}_error_mean"] = (float(np.average(means, weights=counts)), "mm")
        found[f"{key}_error_max"] = (float(largest.max()), "mm")
    return found
