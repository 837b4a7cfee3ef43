"""Marrow probability of one bone in one pose, with the scribbles that correct it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.learned import segment_learned
from handpipe.imaging.segmentation import SegmentationSettings, add_scribbles, check_seeds, save, segment_bone
from handpipe.imaging.volumes import pose_volume, read_labels
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    volume: Path
    seeds: Path
    scribbles: Path


def correct_bone(inputs: Inputs, output: Path, dataset: Dataset, pose: str, bone: str) -> None:
    """Marrow probability of one bone in one pose, with the scribbles that correct it."""
    volume = pose_volume(dataset, pose)
    path = inputs.scribbles
    known = dataset.seed_labels
    seeds = add_scribbles(read_labels(inputs.seeds, volume, known), read_labels(path, volume, known))
    others = set(dataset.bones) - {bone}
    check_seeds(path, seeds, dataset.labels, others, dataset.other_labels)
    if dataset.contrast == "learned":
        learned, wrong = segment_learned([volume], seeds, dataset.labels)
        if bone in wrong:
            raise InputError(path, "scribbles", f"{bone}: {wrong[bone]}", "Draw more of them")
        found = learned[bone]
    else:
        found = segment_bone(volume, seeds, dataset.bones[bone].label, SegmentationSettings.of(dataset))
    save(output, {bone: found}, inputs.all())
