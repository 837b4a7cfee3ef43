"""A scene's frames as a skeleton with skinned bodies and corrective shapes, for riggers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.hand import StoredFrames
from handpipe.hand.exports import write_rigged_glb
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    chunks: Sequence[Path]


def export_rigged(inputs: Inputs, output: Path) -> None:
    """A scene's frames as a skeleton with skinned bodies and corrective shapes, for riggers."""
    frames = StoredFrames(inputs.chunks)
    write_rigged_glb(output, Rig.load(inputs.rig), frames)
