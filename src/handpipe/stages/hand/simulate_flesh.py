"""The flesh in one scanned pose, which carries the hooks of tendons and the muscles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.hand import load_layers, write_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.poses import scanned_frame


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    layers: Sequence[Path]


def simulate_flesh(inputs: Inputs, output: Path, dataset: Dataset, pose: str) -> None:
    """The flesh in one scanned pose, which carries the hooks of tendons and the muscles."""
    rig = Rig.load(inputs.rig)
    frame = scanned_frame(rig, pose)
    bones, flesh = load_layers(["bones", "flesh"], dataset, inputs.layers, rig.surfaces)
    below = {bones.name: bones.solve(frame, {})}
    write_frames(output, [(frame, {flesh.name: flesh.solve(frame, below)})], inputs.all())
