"""A scene's frames as OBJ files, for programs that read nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.hand import StoredFrames, write_obj_sequence
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    chunks: Sequence[Path]


def export_obj(inputs: Inputs, output: Path) -> None:
    """A scene's frames as OBJ files, for programs that read nothing else."""
    frames = StoredFrames(inputs.chunks)
    write_obj_sequence(output, frames)
