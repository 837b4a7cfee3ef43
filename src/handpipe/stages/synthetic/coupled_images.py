"""Volume, scan, truth and label volumes of one pose of a coupled body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.stages.files import Files
from handpipe.synthetic.template_hands import coupled_hand


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    body: Path
    subject: Path
    positions: Path


def coupled_images(inputs: Inputs, dataset: Dataset, pose: str, order: int) -> None:
    """Volume, scan, truth and label volumes of one pose of a coupled body."""
    given = inputs
    hand = coupled_hand.hand_body(given.body, given.subject, order)
    found = coupled_hand.load(given.positions)
    coupled_hand.write_pose(dataset, pose, hand, found)
