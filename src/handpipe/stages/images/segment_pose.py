"""Probability of every bone in one pose: of its marrow, or of the whole bone where strokes teach its look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.learned import segment_learned
from handpipe.imaging.segmentation import SegmentationSettings, check_seeds, save, segment
from handpipe.imaging.volumes import pose_volume, read_labels
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    volume: Path
    seeds: Path


def segment_pose(inputs: Inputs, output: Path, dataset: Dataset, pose: str, scribbled: Sequence[str]) -> None:
    """Probability of every bone in one pose: of its marrow, or of the whole bone if its look is learned."""
    path = inputs.seeds
    volume = pose_volume(dataset, pose)
    bones = dataset.labels
    seeds = read_labels(path, volume, dataset.seed_labels)
    drawn = dataset.poses[pose].seeds is not None  # else proposed, but for bones that a person has to look at
    check_seeds(path, seeds, bones, scribbled if drawn else bones, dataset.other_labels)
    if dataset.contrast == "learned":
        found, wrong = segment_learned([volume], seeds, bones)
    else:
        found, wrong = segment(volume, seeds, bones, SegmentationSettings.of(dataset))
    missing = [name for name in wrong if name not in scribbled]
    if pose == dataset.neutral and missing:
        problem = "; ".join(f"{name}: {wrong[name]}" for name in missing)
        raise InputError(path, "seeds", problem, "Draw the strokes of every bone in its marrow")
    save(output, found, inputs.all())
