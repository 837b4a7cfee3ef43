"""Stated deviations of a scene's frames: an artifact beside them, and VTU series that carry them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.hand import StoredFrames, write_vtu_series
from handpipe.hand.deviations import HandDeviations, with_deviations, write_stated
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    deviations: Path
    chunks: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    stated: Path
    vtk: Path


def state_deviations(inputs: Inputs, outputs: Outputs) -> None:
    """Stated deviations of a scene's frames: an artifact beside them, and VTU series that carry them."""
    rig, known = Rig.load(inputs.rig), HandDeviations.load(inputs.deviations)
    frames = with_deviations(StoredFrames(inputs.chunks), rig, known)
    Path(outputs.vtk).mkdir(parents=True, exist_ok=True)
    write_vtu_series(outputs.vtk, frames)
    write_stated(outputs.stated, frames, rig, known, inputs.all())
