"""The index of a training set, and what its frames share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import InputError, artifacts
from handpipe.core.configuration import Dataset, Scene
from handpipe.hand import StoredFrames
from handpipe.levels.shards import ShardIndex, write_bodies
from handpipe.skeleton.drivers import landmark_map
from handpipe.skeleton.motion import read_random_file
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    random: Path
    chunks: Sequence[Path]
    shards: Sequence[Path]


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    index: Path
    bodies: Path


def index_shards(inputs: Inputs, outputs: Outputs, dataset: Dataset, scene: Scene, name: str) -> None:
    """The index of a training set, and what its frames share. name: of the scene."""
    rig, frames = Rig.load(inputs.rig), StoredFrames(inputs.chunks)
    if not len(frames):
        remedy = "Look at the reasons in its shards; ask for other random poses"
        raise InputError(f"scene {name}", "frames", "all of them failed", remedy)
    write_bodies(outputs.bodies, rig, frames[0][1])
    commits = {str(artifacts.read_attributes(chunk).get("commit", "")) for chunk in inputs.chunks}
    made = {
        "subject": dataset.name,
        "hand": dataset.hand,
        "licence": dataset.licence,
        "scene": name,
        "level": scene.level,
        "learned": scene.learned,
        "random": read_random_file(inputs.random).model_dump(),
        "commits": sorted(commits),
    }
    ShardIndex(made, rig, landmark_map(rig)).write(outputs.index, inputs.shards, outputs.bodies)
