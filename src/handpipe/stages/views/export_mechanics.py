"""A scene's frames with strains, stresses, fibre stretch and contact pressure, as VTU series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset, Scene
from handpipe.hand import StoredFrames, load_layers, write_vtu_series
from handpipe.hand.exports import with_mechanics
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    chunks: Sequence[Path]
    layers: Sequence[Path]


def export_mechanics(inputs: Inputs, output: Path, dataset: Dataset, scene: Scene) -> None:
    """A scene's frames with strains, stresses, fibre stretch and contact pressure, as VTU series."""
    rig = Rig.load(inputs.rig)
    layers = load_layers(scene.needed, dataset, inputs.layers, rig.surfaces)
    frames = StoredFrames(inputs.chunks)
    Path(output).mkdir(parents=True, exist_ok=True)
    write_vtu_series(output, with_mechanics(frames, layers, rig.parents))
