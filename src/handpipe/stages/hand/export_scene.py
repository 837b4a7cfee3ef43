"""A scene's frames for other programs: VTU series with .pvd, and glTF with the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.hand import StoredFrames, write_glb, write_vtu_series
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    chunks: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    glb: Path
    vtk: Path


def export_scene(inputs: Inputs, outputs: Outputs) -> None:
    """A scene's frames for other programs: VTU series with .pvd, and glTF with the motion."""
    frames = StoredFrames(inputs.chunks)
    Path(outputs.vtk).mkdir(parents=True, exist_ok=True)
    write_vtu_series(outputs.vtk, frames)
    write_glb(outputs.glb, frames)
