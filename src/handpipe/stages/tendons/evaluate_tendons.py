"""Simulated tendons against truth, in example and held-out poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import metrics
from handpipe.core.configuration import Dataset, Role
from handpipe.skeleton.rig import Rig
from handpipe.stages.costs import stage_cost
from handpipe.stages.files import Files
from handpipe.stages.poses import flesh_in_poses
from handpipe.stages.truth import true_pose
from handpipe.tissues.tendons import Tendon
from handpipe.tissues.tendons.fitting import centreline_errors
from handpipe.tissues.tendons.rods import length_change


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    tendons: Sequence[Path]
    flesh: Sequence[Path]
    truth: Sequence[Path]


def evaluate_tendons(inputs: Inputs, output: Path, dataset: Dataset, costs: Sequence[Path]) -> None:
    """Simulated tendons against truth, in example and held-out poses."""
    rig = Rig.load(inputs.rig)
    figures = stage_cost(costs)
    errors: dict[Role, list[np.ndarray]] = {Role.example: [], Role.heldout: []}
    changes = []
    poses = [*dataset.examples, *dataset.heldout]
    flesh = {pose: shape.vertices for pose, shape in flesh_in_poses(inputs.flesh).items()}
    for path in inputs.tendons:
        tendon = Tendon.load(path)
        for pose in poses:
            x = tendon.solve(rig.scanned_bones(pose), flesh.get(pose)).x
            changes.append(100 * length_change(x, tendon.rest.length))
            if dataset.truth is None:
                continue
            true = true_pose(inputs.truth, pose)["tendons"][tendon.name]
            line = rig.poses[pose].root.inverse()(true["centreline"])
            errors[dataset.poses[pose].role].append(np.concatenate(centreline_errors(x, line)))
    if changes:
        figures["length_change_max"] = (float(np.max(changes)), "%")
    if errors[Role.example]:
        figures |= metrics.summary("centreline_error", np.concatenate(errors[Role.example]), "mm")
    if errors[Role.heldout]:
        figures |= metrics.summary("heldout_centreline_error", np.concatenate(errors[Role.heldout]), "mm")
    metrics.write(output, figures)
