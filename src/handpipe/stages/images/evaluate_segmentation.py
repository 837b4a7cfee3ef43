"""How the bones look in every pose; Dice against truth: whole bones in neutral, marrow elsewhere."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import metrics
from handpipe.core.configuration import Dataset
from handpipe.evaluation import dice, looks_figures
from handpipe.imaging.segmentation import read_looks
from handpipe.imaging.volumes import read_labels, read_volume
from handpipe.stages.costs import pose_cost, stage_cost
from handpipe.stages.files import Files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    labels: Sequence[Path]
    looks: Sequence[Path]
    truth: Sequence[Path]


def evaluate_segmentation(inputs: Inputs, output: Path, dataset: Dataset, costs: Sequence[Path]) -> None:
    """How the bones look in every pose; Dice against truth: whole bones in neutral, marrow elsewhere."""
    figures = stage_cost(costs) | pose_cost(costs, dataset.poses)
    read = {p: read_looks(f) for p, f in zip(dataset.poses, inputs.looks, strict=True)}
    looks = {pose: bones for pose, (bones, _) in read.items()}
    left_out = {pose: reasons for pose, (_, reasons) in read.items()}
    figures |= looks_figures(looks, left_out, dataset.neutral)
    for pose, bones in left_out.items():
        for name, reason in bones.items():
            log.warning("%s in %s is left out: %s", name, pose, reason)
    if dataset.truth is not None:
        overlaps: dict[str, float] = {}
        for pose, path, true in zip(dataset.poses, inputs.labels, inputs.truth, strict=True):
            labels = read_labels(path)
            truth = read_labels(true, read_volume(path))
            overlaps |= {
                f"dice_{pose}_{name}": dice(labels, truth, b.label) for name, b in dataset.bones.items()
            }
        figures |= {name: (value, "1") for name, value in overlaps.items()}
        figures["dice_mean"] = (sum(overlaps.values()) / len(overlaps), "1")
        figures["dice_min"] = (min(overlaps.values()), "1")
    metrics.write(output, figures)
