"""Rigid registration of every bone's neutral marrow into one pose, from the root outwards."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.hand import with_carried_hints
from handpipe.skeleton.bones import read_surfaces, write_registrations
from handpipe.skeleton.registration import register_pose, unmoved
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    neutral: Path
    target: Path
    carried: Path | None = None


def register_bones(inputs: Inputs, output: Path, dataset: Dataset, pose: str) -> None:
    """Rigid registration of every bone's neutral marrow into one pose, from the root outwards."""
    dataset = with_carried_hints(dataset, inputs.carried)
    neutral, target = (read_surfaces(p, "marrow") for p in (inputs.neutral, inputs.target))
    found = unmoved(neutral) if pose == dataset.neutral else register_pose(dataset, neutral, target)
    write_registrations(output, found, inputs.all())
