"""A template hand as one body of all tissues, whose joints can open."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.config import Dataset
from handpipe.datasets import coupled_hand
from handpipe.datasets.known_hands import known_hand
from handpipe.stages.files import Files
from handpipe.truth import anatomy_file

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    template: Path
    subject: Path


def coupled_body(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """A template hand as one body of all tissues, whose joints can open."""
    motion = known_hand(dataset).motion
    anatomy = coupled_hand.opened_hand(inputs.template, inputs.subject, motion)
    log.info("%d tets, %d vertices", len(anatomy.mesh.tets), len(anatomy.mesh.vertices))
    anatomy_file.save(output, anatomy, inputs.all())
