"""Rigid registration of every bone's neutral marrow into one pose, from the root outwards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.hand import with_carried_hints
from handpipe.imaging.volumes import pose_volume
from handpipe.skeleton.bones import read_surfaces, write_registrations
from handpipe.skeleton.registration import PoseImages, register_pose, unmoved
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    neutral: Path
    target: Path
    carried: Path | None = None
    images: Sequence[Path] = ()


def register_bones(inputs: Inputs, output: Path, dataset: Dataset, pose: str) -> None:
    """Rigid registration of every bone's neutral marrow into one pose, from the root outwards."""
    dataset = with_carried_hints(dataset, inputs.carried)
    neutral, target = (read_surfaces(p, "marrow") for p in (inputs.neutral, inputs.target))
    if pose == dataset.neutral:
        found = unmoved(neutral)
    else:
        found = register_pose(dataset, neutral, target, _images(inputs, dataset, pose))
    write_registrations(output, found, inputs.all())


def _images(inputs: Inputs, dataset: Dataset, pose: str) -> PoseImages | None:
    """The images of neutral and of the pose, where the dataset asks for a refinement by them."""
    if dataset.registration != "images":
        return None
    still, moved = pose_volume(dataset, dataset.neutral), pose_volume(dataset, pose)
    return PoseImages(still, moved, read_surfaces(inputs.neutral, "whole"))
