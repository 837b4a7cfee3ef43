"""Equilibrium of a generated subject's coupled body in one pose."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.stages.files import Files
from handpipe.synthetic.template_hands import coupled_hand, known_hand

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    body: Path
    subject: Path


def coupled_pose(inputs: Inputs, output: Path, dataset: Dataset, pose: str, order: int) -> None:
    """Equilibrium of a generated subject's coupled body in one pose."""
    hand = coupled_hand.hand_body(inputs.body, inputs.subject, order)
    log.info("%d tets, %d nodes", len(hand.body.anatomy.mesh.tets), len(hand.body.rest))
    motion = known_hand(dataset).motion
    found = coupled_hand.settle(hand, motion, pose)
    coupled_hand.save(output, found, inputs.all())
