"""The frames of one chunk of a scene, as its driver's file gives them."""

from __future__ import annotations

from pathlib import Path

from handpipe.core import Frame
from handpipe.core.configuration import Dataset, Scene
from handpipe.skeleton.drivers import read_frames
from handpipe.skeleton.rig import Rig


def driven_frames(file: Path, rig: Rig, dataset: Dataset, scene: Scene, chunk: int) -> list[Frame]:
    """Frames of a chunk, by its number from 0, of a scene whose frames a file drives."""
    driven = list(read_frames(file, rig, hand=dataset.hand, bones=scene.bones).items())
    first = chunk * scene.chunk
    return [
        Frame(name, angles, rig.bone_transforms(angles))
        for name, angles in driven[first : first + scene.chunk]
    ]
