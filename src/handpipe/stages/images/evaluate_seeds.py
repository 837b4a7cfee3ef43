"""How many bones a person has to look at after neutral, and proposed seeds against truth."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import metrics
from handpipe.core.configuration import Dataset
from handpipe.imaging.segmentation import marrow_core, share_outside
from handpipe.imaging.volumes import pose_volume, read_labels
from handpipe.skeleton.bones import read_surfaces
from handpipe.skeleton.localisation import moved_surfaces, read_located
from handpipe.stages.costs import stage_cost
from handpipe.stages.files import Files

log = logging.getLogger(__name__)
WRONG = 0.2  # of a bone's seeds outside its true marrow


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    neutral: Path
    located: Sequence[Path]
    volumes: Sequence[Path]
    truth: Sequence[Path]


def evaluate_seeds(
    inputs: Inputs, output: Path, dataset: Dataset, poses: Sequence[str], costs: Sequence[Path]
) -> None:
    """How many bones a person has to look at after neutral, and proposed seeds against truth."""
    neutral = read_surfaces(inputs.neutral, "marrow")
    confidences, manual, wrong, unnoticed = [], 0, 0, 0
    truths = dict(zip(poses, inputs.truth, strict=dataset.truth is not None))
    for pose, located in zip(poses, inputs.located, strict=True):
        motions, sure = read_located(located)
        marked = {bone for bone, confidence in sure.items() if confidence.marked}
        confidences += [confidence.value for confidence in sure.values()]
        manual += len(marked)
        if dataset.truth is None:
            continue
        volume = pose_volume(dataset, pose)
        truth = read_labels(truths[pose], volume)
        for bone, surface in moved_surfaces(neutral, motions).items():
            outside = share_outside(marrow_core(volume, surface), truth, dataset.bones[bone].label)
            if outside > WRONG:
                log.warning("%s in %s: %.0f %% of its seeds outside its marrow", bone, pose, 100 * outside)
                wrong, unnoticed = wrong + 1, unnoticed + (bone not in marked)
    figures = stage_cost(costs)
    figures |= {"proposed_bones": (len(confidences), "1"), "manual_bones": (manual, "1")}
    if confidences:
        figures |= {
            "confidence_min": (min(confidences), "1"),
            "confidence_mean": (sum(confidences) / len(confidences), "1"),
        }
    if dataset.truth is not None:
        figures |= {"wrong_bones": (wrong, "1"), "unnoticed_wrong_bones": (unnoticed, "1")}
    metrics.write(output, figures)
