"""What a person would bring to a subject that is made from a coupled body."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.anatomy.templates import TissueMesh
from handpipe.core.configuration import Dataset
from handpipe.stages.files import Files
from handpipe.synthetic.template_hands import coupled_hand, marked_ends


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    template: Path
    body: Path
    subject: Path
    positions: Path


def coupled_templates(inputs: Inputs, dataset: Dataset, order: int) -> None:
    """What a person would bring to a subject that is made from a coupled body."""
    given = inputs
    hand = coupled_hand.hand_body(given.body, given.subject, order)
    marked = marked_ends(TissueMesh.load(given.template), hand.subject)
    neutral = coupled_hand.load(given.positions)
    coupled_hand.write_templates(dataset, hand, neutral, marked)
