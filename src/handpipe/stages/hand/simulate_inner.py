"""All layers under the fat in one scanned pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.hand import load_layers, read_frames, simulate_frame, write_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.poses import scanned_frame


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    layers: Sequence[Path]
    flesh: Path | None


def simulate_inner(inputs: Inputs, output: Path, dataset: Dataset, pose: str, layers: Sequence[str]) -> None:
    """All layers under the fat in one scanned pose."""
    rig = Rig.load(inputs.rig)
    loaded = load_layers(layers, dataset, inputs.layers, rig.surfaces)
    frame = scanned_frame(rig, pose)
    known = read_frames(inputs.flesh)[0][1] if inputs.flesh else None
    write_frames(output, [(frame, simulate_frame(frame, loaded, known))], inputs.all())
