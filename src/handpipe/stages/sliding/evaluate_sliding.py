"""Checks of bodies that slide on one another by themselves: forces, gaps, slides, volumes."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import metrics
from handpipe.stages.costs import stage_cost
from handpipe.stages.files import Files
from handpipe.synthetic.coupled import volume_changes
from handpipe.synthetic.sliding import finger_poses, finger_subject

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    body: Path
    neutral: Path
    positions: Sequence[Path]


def evaluate_sliding(inputs: Inputs, output: Path, costs: Sequence[Path]) -> None:
    """Checks of bodies that slide on one another by themselves: forces, gaps, slides, volumes."""
    body, neutral = finger_poses.load_body(inputs.body), finger_subject.load(inputs.neutral)
    found: metrics.Metrics = {
        "tets": (len(body.anatomy.mesh.tets), "1"),
        "nodes": (len(body.rest), "1"),
        "poses": (len(inputs.positions), "1"),
    }
    changes, slid, checks = [], [], []
    for file in inputs.positions:
        x = finger_subject.load(file)
        checks.append(finger_poses.checks(body, file.stem, x))
        changes += [abs(change) for change in volume_changes(body, x).values()]
        slid.append(np.concatenate([*finger_poses.slides(body, neutral, x).values()]))
        log.info("%s: %s, slid by up to %.2f mm", file.stem, checks[-1], slid[-1].max())
    found |= metrics.summary("muscle_volume_change", np.array(changes), "%")
    found |= metrics.summary("slide", max(slid, key=np.mean), "mm")
    found["unbalanced_force_max"] = (max(c.unbalanced for c in checks), "mN")
    found["gap_min"] = (min(c.gap for c in checks), "mm")
    found["void_max"] = (max(c.void for c in checks), "mm^3")
    found["inverted_tets"] = (sum(c.inverted for c in checks), "1")
    found["volume_ratio_min"] = (min(c.volume_ratio for c in checks), "1")
    metrics.write(output, found | stage_cost(costs))
