"""All layers under the fat in one scanned pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.config import Dataset
from handpipe.hand.frames import read_frames, write_frames
from handpipe.hand.layer_loading import load_layers
from handpipe.hand.simulation import simulate_frame
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
