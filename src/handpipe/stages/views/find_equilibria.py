"""Whether the frames of a chunk have other equilibria: their fat or soft tissue from other starts."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts
from handpipe.core.configuration import Dataset, Scene
from handpipe.evaluation import Row
from handpipe.hand import load_layers, read_frames
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.fat import Restart, TissueLayer, restarts

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    frames: Path
    layers: Sequence[Path]


def find_equilibria(inputs: Inputs, output: Path, dataset: Dataset, scene: Scene) -> None:
    """Whether the frames of a chunk have other equilibria: their fat or soft tissue from other starts.

    Starts are the blend of the bones, and the frames before and after in the chunk. The output has a row a
    frame, in the order of the chunk.
    """
    rig = Rig.load(inputs.rig)
    frames = read_frames(inputs.frames)
    layers = load_layers(scene.needed, dataset, inputs.layers, rig.surfaces)
    outermost = next(layer for layer in layers if isinstance(layer, TissueLayer))
    rows = []
    for i, (frame, shapes) in enumerate(frames):
        around = [*frames[max(i - 1, 0) : i], *frames[i + 1 : i + 2]]
        rows.append(_row(frame.name, restarts(outermost, frame, shapes, around)))
        log.info("frame %s: %d of %d frames", frame.name, i + 1, len(frames))
    artifacts.write_text(output, json.dumps({"frames": rows}, indent=2))


def _row(frame: str, found: Sequence[Restart]) -> Row:
    """How many starts of a frame led elsewhere, and the one that led farthest."""
    others = [restart for restart in found if restart.other]
    row: dict[str, str | float] = {
        "frame": frame,
        "starts": len(found),
        "starts_without_result": sum(not restart.settled for restart in found),
        "other_equilibria": len(others),
    }
    if others:
        farthest = max(others, key=lambda restart: restart.largest)
        row |= {"other_start": farthest.start, "other_energy": farthest.energy}
        row |= {"other_skin_mean": farthest.mean, "other_skin_max": farthest.largest}
    return row
