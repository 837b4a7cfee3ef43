"""Equilibrium of bodies that slide on one another in one pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.stages.files import Files
from handpipe.synthetic.sliding import finger_poses, finger_subject


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads; the neutral pose itself is followed from the shapes at rest."""

    body: Path
    neutral: Path | None = None


def sliding_pose(inputs: Inputs, output: Path, pose: str) -> None:
    """Equilibrium of bodies that slide on one another in one pose."""
    body = finger_poses.load_body(inputs.body)
    start = None if inputs.neutral is None else finger_subject.load(inputs.neutral)
    finger_subject.save(output, finger_poses.settle(body, pose, start).x, inputs.all())
