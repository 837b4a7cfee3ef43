"""A page that moves a learned hand: sliders for its joints, fingertips to drag, organs to switch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.evaluation.player import write_player
from handpipe.imaging.volumes import pose_volume
from handpipe.levels import LearnedHand
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    levels: Path
    volume: Path | None = None  # of the neutral pose; without it the page shows no slices


def export_player(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """A page that moves a learned hand: sliders for its joints, fingertips to drag, organs to switch."""
    hand, rig = LearnedHand.load(inputs.levels), Rig.load(inputs.rig)
    image = None if inputs.volume is None else pose_volume(dataset, dataset.neutral)
    write_player(output, dataset.name, hand, rig, dataset.hand, image=image)
