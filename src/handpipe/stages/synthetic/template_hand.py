"""The template hand of a generated subject: all organs from the file of curves."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from handpipe.anatomy.templates import build_hand, load_hand
from handpipe.core import metrics
from handpipe.core.configuration import Dataset
from handpipe.fem.linear import factorise
from handpipe.stages.files import Files
from handpipe.synthetic.family import build_of
from handpipe.synthetic.template_hands import at_its_size, bare_hand, of_build

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    curves: Path


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    tissue: Path
    subject: Path
    metrics: Path


def template_hand(inputs: Inputs, outputs: Outputs, dataset: Dataset, edges: Mapping[str, float]) -> None:
    """The template hand of a generated subject: all organs from the file of curves.

    A hand of a measured person is made as large as the median one, where the file's lengths and the edges
    hold, and then gets its size.
    """
    file = load_hand(inputs.curves)
    build = None if dataset.proportions is None else build_of(dataset.proportions)
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        bare = bare_hand(edges["bone"], edges["skin"], build)
        if build is not None:
            file = of_build(file, build, bare.bones, source=inputs.curves)
        hand = build_hand(file, bare, edges["fat"], factorise=factorise, source=inputs.curves)
        hand = hand if build is None else at_its_size(hand, build)
    hand.tissue.save(outputs.tissue, [inputs.curves])
    hand.subject.save(outputs.subject, [inputs.curves])
    metrics.write(outputs.metrics, hand.metrics() | figures)
    log.info("%d tets, %d tissues", len(hand.tissue.labels), len(hand.tissue.names))
