"""One chunk of a scene of random poses as a shard of a training set; failed frames are recorded."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset, Scene
from handpipe.evaluation import worst_figures
from handpipe.hand import read_simulated
from handpipe.levels.shards import Shard
from handpipe.skeleton.drivers import landmark_map
from handpipe.skeleton.rig import Rig
from handpipe.stages.driven_frames import driven_frames
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    frames: Path
    chunk: Path


def make_shard(inputs: Inputs, output: Path, dataset: Dataset, scene: Scene, chunk: int) -> None:
    """One chunk of a scene of random poses as a shard of a training set; failed frames are recorded."""
    rig = Rig.load(inputs.rig)
    wanted = driven_frames(inputs.frames, rig, dataset, scene, chunk)
    frames, failures = read_simulated(inputs.chunk)
    figures = [worst_figures(layers) for _, layers in frames]
    Shard(wanted, chunk * scene.chunk, frames, failures, figures).write(output, rig, landmark_map(rig))
    for failure in failures:
        print(f"handpipe: make_shard: {failure}; the shard records it as invalid", file=sys.stderr)
