"""A template hand as one body of all tissues, whose joints can open."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.stages.files import Files
from handpipe.synthetic.coupled import anatomy_file
from handpipe.synthetic.template_hands import coupled_hand, known_hand

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    template: Path
    subject: Path


def coupled_body(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """A template hand as one body of all tissues, whose joints can open."""
    anatomy = coupled_hand.opened_hand(inputs.template, inputs.subject, known_hand(dataset))
    log.info("%d tets, %d vertices", len(anatomy.mesh.tets), len(anatomy.mesh.vertices))
    anatomy_file.save(output, anatomy, inputs.all())
