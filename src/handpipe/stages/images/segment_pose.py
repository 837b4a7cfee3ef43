"""Probability of every bone in one pose: of its marrow, or of the whole bone where its look is learned.

A label map answers for the bones that it holds.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.hand import labelled_bones
from handpipe.imaging.learned import segment_learned
from handpipe.imaging.segmentation import (
    BoneProbability,
    SegmentationSettings,
    check_seeds,
    labelled_bone,
    save,
    segment,
)
from handpipe.imaging.volumes import Volume, pose_channels, pose_volume
from handpipe.mesh.surfaces import Surface
from handpipe.stages.files import Files
from handpipe.stages.images.known_seeds import known_seeds

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    volume: Path
    seeds: Path | None
    labels: Path | None = None
    channels: Sequence[Path] = ()


def segment_pose(inputs: Inputs, output: Path, dataset: Dataset, pose: str, scribbled: Sequence[str]) -> None:
    """Probability of every bone in one pose, each from its seeds or from a label map."""
    volume = pose_volume(dataset, pose)
    labelled = labelled_bones(inputs.labels, dataset, pose, volume)
    found = _segmented(inputs, dataset, pose, scribbled, volume, labelled)
    for name in (name for name in dataset.bones if name in labelled):
        shown = dataset.poses[pose].labels_show
        log.info("%s: from the label map, which shows its %s", name, shown)
        found[name] = labelled_bone(volume, labelled[name], shown, str(inputs.labels), name)
    save(output, found, inputs.all())


def _segmented(
    inputs: Inputs,
    dataset: Dataset,
    pose: str,
    scribbled: Sequence[str],
    volume: Volume,
    labelled: Mapping[str, Surface],
) -> dict[str, BoneProbability]:
    """Marrow of the bones that no label map holds."""
    bones = {name: label for name, label in dataset.labels.items() if name not in labelled}
    if not bones:
        return {}
    path = inputs.seeds or f"poses.{pose}"
    seeds = known_seeds(inputs.seeds, volume, dataset, labelled)
    drawn = dataset.poses[pose].seeds is not None  # else proposed, but for bones that a person has to look at
    others = {name: label for name, label in dataset.seed_labels.items() if name not in bones}
    check_seeds(path, seeds, bones, scribbled if drawn else bones, others)
    if dataset.contrast == "learned":
        channels = [volume, *pose_channels(dataset, pose, volume).values()]
        found, wrong = segment_learned(channels, seeds, bones)
    else:
        found, wrong = segment(volume, seeds, bones, SegmentationSettings.from_dataset(dataset))
    missing = [name for name in wrong if name not in scribbled]
    if pose == dataset.neutral and missing:
        problem = "; ".join(f"{name}: {wrong[name]}" for name in missing)
        raise InputError(path, "seeds", problem, "Draw the strokes of every bone in its marrow")
    return found
