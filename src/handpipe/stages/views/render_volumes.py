"""The moved neutral image of a scene as two movies of volumes: all anatomy, and fat alone."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Dataset
from handpipe.evaluation import camera_views
from handpipe.evaluation.rendering import (
    TRANSFERS,
    Camera,
    Image,
    Transfer,
    render_volume,
    volume_extent,
    write_movie,
)
from handpipe.hand import StoredFrames
from handpipe.imaging.volumes import read_volume
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.views.render_movie import SIZE, require_no_failures

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    chunks: Sequence[Path]
    images: Path


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    anatomy: Path
    fat: Path


def render_volumes(inputs: Inputs, outputs: Outputs, dataset: Dataset) -> None:
    """The moved neutral image of a scene as two movies of volumes: all anatomy, and fat alone."""
    require_no_failures(inputs.chunks)
    files = sorted(inputs.images.glob("frame-*.nii.gz"))
    if not files:
        raise InputError(inputs.images, "frames", "the scene has none", "Give it frames")
    first = read_volume(files[0])
    frame, _ = StoredFrames(inputs.chunks)[0]
    palm = camera_views(Rig.load(inputs.rig), frame, dataset.hand)["palm"]
    camera = Camera.fit(volume_extent(first), *palm, SIZE)
    for name, path in {"anatomy": outputs.anatomy, "fat": outputs.fat}.items():
        write_movie(path, _pictures(files, TRANSFERS[name], first.bright, camera), len(files))


def _pictures(files: Sequence[Path], transfer: Transfer, bright: float, camera: Camera) -> Iterator[Image]:
    for path in files:
        log.info("volume %s", path.name)
        yield render_volume(read_volume(path), transfer, bright, camera, SIZE)
