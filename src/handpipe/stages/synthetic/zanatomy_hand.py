"""The template hand of real anatomy, and a list of all that was repaired for it."""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts, metrics
from handpipe.core.configuration import Dataset
from handpipe.fem.linear import factorise
from handpipe.stages.files import Files
from handpipe.synthetic.real_anatomy import folder_of
from handpipe.synthetic.template_hands import zanatomy_hand as real_anatomy

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    tissue: Path
    subject: Path
    metrics: Path
    repairs: Path


def zanatomy_hand(outputs: Outputs, dataset: Dataset, edges: Mapping[str, float]) -> None:
    """The template hand of real anatomy, and a list of all that was repaired for it."""
    folder = folder_of(dataset)
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        hand = real_anatomy.build(folder, edges, factorise=factorise)
    hand.template.tissue.save(outputs.tissue)
    hand.template.subject.save(outputs.subject)
    artifacts.write_text(outputs.repairs, json.dumps(hand.repairs, indent=2))
    metrics.write(outputs.metrics, hand.template.metrics() | figures)
    for row in hand.repairs:
        log.info("%s: %s: %.4g %s", row["organ"], row["what"], row["value"], row["unit"])
