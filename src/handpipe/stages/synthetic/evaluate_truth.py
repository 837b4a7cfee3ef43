"""Checks of a coupled body by itself: patch test, volumes, inverted tets, skin that cuts itself."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import metrics
from handpipe.core.configuration import Dataset
from handpipe.stages.costs import stage_cost
from handpipe.stages.files import Files
from handpipe.synthetic.coupled import patch_test, volume_changes
from handpipe.synthetic.template_hands import coupled_hand, known_hand

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    body: Path
    subject: Path
    positions: Sequence[Path]


def evaluate_truth(inputs: Inputs, output: Path, dataset: Dataset, order: int, costs: Sequence[Path]) -> None:
    """Checks of a coupled body by itself: patch test, volumes, inverted tets, skin that cuts itself."""
    given = inputs
    hand = coupled_hand.hand_body(given.body, given.subject, order)
    motion = known_hand(dataset).motion
    positions = {Path(file).stem: coupled_hand.load(file) for file in given.positions}
    body, changes, ratios, inverted, crossing = hand.body, [], [], 0, 0
    found: metrics.Metrics = {"tets": (len(body.anatomy.mesh.tets), "1"), "nodes": (len(body.rest), "1")}
    for pose, x in positions.items():
        changes.append(list(volume_changes(body, x).values()))
        ratios.append(float(body.solid.volume_ratios(x).min()))
        inverted += body.inverted(x)
        crossing += coupled_hand.cuts_itself(body, x)
        log.info(
            "%s: muscles' volumes change by %.2f %% at most, least volume ratio %.3f",
            pose,
            np.abs(changes[-1]).max(),
            ratios[-1],
        )
    found |= metrics.summary("muscle_volume_change", np.abs(changes), "%")
    found["volume_ratio_min"] = (min(ratios), "1")
    found["inverted_tets"] = (inverted, "1")
    found["poses"] = (len(ratios), "1")
    found["poses_cutting_themselves"] = (crossing, "1")
    one, other, apart = coupled_hand.start_difference(hand, motion, positions)
    log.info("%s: the solution from %s differs by %.3g mm from the one from rest", other, one, apart)
    found["start_difference_max"] = (apart, "mm")
    refined, errors = coupled_hand.refinement_errors(hand, motion, positions)
    for ray, figures in errors.items():
        (rms, _), (largest, _) = figures["rms"], figures["max"]
        log.info(
            "%s, %s: linear tets %.3f mm (rms), %.2f mm (max) from quadratic ones", refined, ray, rms, largest
        )
    for kind in ("rms", "max"):
        found[f"refinement_{kind}"] = (max(figures[kind][0] for figures in errors.values()), "mm")
    found["patch_test_error"] = (patch_test(body), "mm")
    metrics.write(output, found | stage_cost(costs))
