"""The neutral image moved with every frame of a scene: a series of volumes, and slices with contours."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.evaluation.moved_images import Row, anatomical_planes, write_slices
from handpipe.hand import StoredFrames, grid_around, places_in_neutral, skin_of
from handpipe.hand.exports import write_numbers
from handpipe.imaging.volumes import pose_volume, write_volume
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    volume: Path
    chunks: Sequence[Path]


def move_images(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """The neutral image moved with every frame of a scene: a series of volumes, and slices with contours."""
    rig = Rig.load(inputs.rig)
    neutral = pose_volume(dataset, dataset.neutral)
    frames = StoredFrames(inputs.chunks)
    output.mkdir(parents=True, exist_ok=True)
    write_numbers(output, frames.names)
    if not frames:
        return
    grid = grid_around([skin_of(layers) for _, layers in frames], float(neutral.spacing.min()))
    for number, (frame, layers) in enumerate(frames):
        start = time.perf_counter()
        moved = places_in_neutral(grid, frame, layers)
        image = moved.on_grid(moved.values(neutral))
        write_volume(output / f"frame-{number:04d}.nii.gz", image)
        row = Row(frame.name, image.sample, (0.0, neutral.bright))
        planes = anatomical_planes(rig, frame, layers)
        write_slices(output / f"frame-{number:04d}.png", [row], planes, layers)
        log.info(
            "frame %s: image of %d voxels in %.1f s", frame.name, len(moved.rest), time.perf_counter() - start
        )
