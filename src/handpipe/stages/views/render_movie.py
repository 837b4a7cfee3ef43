"""A scene as a movie: the skin and the organs inside it, seen from the palm."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from handpipe.core import Array, Frame, InputError, Shapes
from handpipe.core.configuration import Dataset
from handpipe.evaluation import camera_views, extent, inner_picture, outer_picture
from handpipe.evaluation.rendering import Camera, Image, write_movie
from handpipe.hand import StoredFrames, failures_in
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files

log = logging.getLogger(__name__)

SIZE = (480, 480)  # pixels of each of the two pictures


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    chunks: Sequence[Path]


def render_movie(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """A scene as a movie: the skin and the organs inside it, seen from the palm."""
    require_no_failures(inputs.chunks)
    camera, count = _camera(inputs, dataset.hand)
    write_movie(output, (_picture(*frame, camera) for frame in StoredFrames(inputs.chunks)), count)


def require_no_failures(chunks: Sequence[Path]) -> None:
    """Raise `InputError` if a frame failed."""
    for chunk in chunks:
        if failed := failures_in(chunk):
            names = ", ".join(failure.frame for failure in failed)
            remedy = "Build again when their cause is mended: only these frames are simulated"
            raise InputError(chunk, "frames", f"{names} failed; a movie without them would jump", remedy)


def _camera(inputs: Inputs, hand: Literal["right", "left"]) -> tuple[Camera, int]:
    """One camera that sees every frame, the first one's palm in front of it; the number of frames."""
    ends: list[Array] = []
    sight = None
    for frame, layers in StoredFrames(inputs.chunks):
        points = extent(layers)
        if sight is None:
            sight = camera_views(Rig.load(inputs.rig), frame, hand)["palm"]
        along = points @ Camera.fit(points, *sight, SIZE).axes.T
        ends.append(points[np.concatenate([along.argmin(axis=0), along.argmax(axis=0)])])
    if sight is None:
        raise InputError(inputs.rig.parent, "frames", "the scene has none", "Give it frames")
    return Camera.fit(ends, *sight, SIZE), len(ends)


def _picture(frame: Frame, layers: Mapping[str, Shapes], camera: Camera) -> Image:
    log.info("frame %s", frame.name)
    return np.concatenate([draw(layers, camera, SIZE) for draw in (outer_picture, inner_picture)], axis=1)
