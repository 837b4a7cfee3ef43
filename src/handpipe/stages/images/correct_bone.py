"""Marrow probability of one bone in one pose, with the scribbles that correct it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.hand import labelled_bones
from handpipe.imaging.learned import segment_learned
from handpipe.imaging.segmentation import SegmentationSettings, add_scribbles, check_seeds, save, segment_bone
from handpipe.imaging.volumes import pose_channels, pose_volume, read_labels
from handpipe.stages.files import Files
from handpipe.stages.images.known_seeds import known_seeds


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    volume: Path
    seeds: Path
    scribbles: Path
    labels: Path | None = None
    channels: Sequence[Path] = ()


def correct_bone(inputs: Inputs, output: Path, dataset: Dataset, pose: str, bone: str) -> None:
    """Marrow probability of one bone in one pose, with the scribbles that correct it."""
    volume = pose_volume(dataset, pose)
    path = inputs.scribbles
    labelled = labelled_bones(inputs.labels, dataset, pose, volume)
    if bone in labelled:
        problem = f"are given, but {inputs.labels} holds the bone, too"
        raise InputError(path, f"scribbles of {bone}", problem, "Remove them, or the bone from the label map")
    seeds = known_seeds(inputs.seeds, volume, dataset, labelled)
    seeds = add_scribbles(seeds, read_labels(path, volume, dataset.seed_labels))
    others = set(dataset.bones) - {bone}
    check_seeds(path, seeds, dataset.labels, others, dataset.other_labels)
    if dataset.contrast == "learned":
        channels = [volume, *pose_channels(dataset, pose, volume).values()]
        learned, wrong = segment_learned(channels, seeds, dataset.labels)
        if bone in wrong:
            raise InputError(path, "scribbles", f"{bone}: {wrong[bone]}", "Draw more of them")
        found = learned[bone]
    else:
        found = segment_bone(
            volume, seeds, dataset.bones[bone].label, SegmentationSettings.from_dataset(dataset)
        )
    save(output, {bone: found}, inputs.all())
