"""The neutral scan, with its texture, as a scene's frames move it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array
from handpipe.core.configuration import Dataset, Scene
from handpipe.hand import StoredFrames
from handpipe.hand.exports import placed_parts, read_textured, write_scan_glb
from handpipe.mesh.files import read_scan
from handpipe.mesh.surfaces import Surface, delta_mush
from handpipe.skeleton.rig import Rig, hand_directions
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    chunks: Sequence[Path]
    scan: Path
    aligned: Path
    textures: Sequence[Path] = ()


def export_scan(inputs: Inputs, output: Path, dataset: Dataset, scene: Scene) -> None:
    """The neutral scan, with its texture, as a scene's frames move it."""
    scan = read_scan(inputs.scan)
    aligned = scan if inputs.aligned == inputs.scan else read_scan(inputs.aligned)
    parts = placed_parts(read_textured(inputs.scan), scan, aligned, inputs.scan)
    directions = hand_directions(Rig.load(inputs.rig), dataset.hand)
    dorsal = None if directions is None else directions.dorsal

    def mushed(skin: Surface, vertices: Array) -> Array:
        smoothed = delta_mush(skin, vertices, scene.delta_mush)
        if dorsal is None:
            return smoothed
        # Folds are on the palmar side; there the skin stays as it is.
        share = np.clip(2.0 * skin.vertex_normals() @ dorsal, 0.0, 1.0)[:, None]
        return np.asarray(vertices + share * (smoothed - vertices))

    frames = StoredFrames(inputs.chunks)
    write_scan_glb(output, parts, frames, finish=mushed if scene.delta_mush else None)
