"""Volume, seeds, scan and truth of one pose of bodies that slide on one another."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.stages.files import Files
from handpipe.synthetic.sliding import finger_poses, finger_subject


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    body: Path
    positions: Path


def sliding_images(inputs: Inputs, dataset: Dataset, pose: str) -> None:
    """Volume, seeds, scan and truth of one pose of bodies that slide on one another."""
    body = finger_poses.load_body(inputs.body)
    finger_subject.write(dataset, pose, body, finger_subject.load(inputs.positions))
