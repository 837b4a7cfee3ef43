"""Seeds of a pose from the neutral bones and the pose's image, and how sure each bone's place is."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import metrics
from handpipe.core.configuration import Dataset, Segmentation
from handpipe.hand import with_carried_hints
from handpipe.imaging.evidence import MarrowEvidence
from handpipe.imaging.segmentation import propose
from handpipe.imaging.volumes import pose_volume, write_labels
from handpipe.skeleton.bones import read_surfaces
from handpipe.skeleton.localisation import (
    HandModel,
    confidences,
    locate,
    moved_surfaces,
    search_again,
    write_located,
)
from handpipe.stages.files import Files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    volume: Path
    neutral: Path
    carried: Path | None = None


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    seeds: Path
    confidence: Path
    located: Path


def propose_seeds(
    inputs: Inputs, outputs: Outputs, dataset: Dataset, pose: str, labelled: Sequence[str] = ()
) -> None:
    """Seeds of a pose from the neutral bones and the pose's image, and how sure each bone's place is."""
    dataset = with_carried_hints(dataset, inputs.carried)
    labels = dataset.labels
    look = dataset.segmentation or Segmentation()
    evidence = MarrowEvidence.measure(pose_volume(dataset, pose), even=look.level == "even")
    marrow, whole = (read_surfaces(inputs.neutral, part) for part in ("marrow", "whole"))
    hand = HandModel.build(dataset, marrow, whole)
    motions = locate(hand, evidence)
    motions, sure = search_again(hand, evidence, motions, confidences(hand, evidence.fine, motions))
    sure = {bone: confidence for bone, confidence in sure.items() if bone not in labelled}
    for bone, confidence in sure.items():
        log.info("%s: %s", bone, confidence.verdict)
        log.info("    %s", confidence)
    marked = [bone for bone, confidence in sure.items() if confidence.marked]
    for bone in (b for b, c in sure.items() if c.near and not c.marked):
        log.warning("%s is %s: look at its seeds", bone, sure[bone].verdict)
    for link in hand.links:
        if link.gapes:
            named = " or ".join(body for i in (link.parent, link.child) for body in hand.bodies[i].bones)
            log.warning(
                "joint %s: its bones are %.1f mm apart in neutral. If they meet there, one of them lacks its "
                "end, and its place in other poses is doubtful: draw scribbles of %s under "
                "poses.%s.scribbles",
                *(link.name, link.neutral_gap, named, dataset.neutral),
            )
    if marked:
        field = f"poses.{pose}.scribbles"
        log.warning("draw scribbles of %s and name them under %s", ", ".join(marked), field)

    marrows, wholes = (
        {labels[b]: s for b, s in moved_surfaces(part, motions).items()} for part in (marrow, whole)
    )
    seeds = propose(evidence.fine, marrows, wholes, unsure=[labels[b] for b in marked], distance=look.around)
    write_labels(outputs.seeds, seeds, evidence.fine.affine)
    write_located(outputs.located, {bone: motions[bone] for bone in sure}, sure, inputs.all())
    figures = {f"confidence_{b}": (c.value, "1") for b, c in sure.items()}
    figures |= {f"marked_{b}": (float(c.marked), "1") for b, c in sure.items()}
    figures |= {f"doubtful_{b}": (1.0, "1") for b, c in sure.items() if c.near}
    figures |= {f"neutral_gap_{link.name}": (link.neutral_gap, "mm") for link in hand.links if link.gapes}
    metrics.write(outputs.confidence, figures)
