"""A built subject with simulated frames of random poses: those to learn from, and those to test on."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from handpipe.core import Layer, artifacts_of, paths
from handpipe.core.configuration import load_dataset, load_scene
from handpipe.hand import SimulatedFrame, StoredFrames, load_layers
from handpipe.levels import LearnedHand, TrainingSet, learn
from handpipe.skeleton.rig import Rig

ROOT = Path(__file__).parents[2]
SUBJECTS = {"finger": ("phantom-finger", "random-finger"), "hand": ("phantom-hand-preview", "random-hand")}
TESTED = 5  # one of so many frames, at the end


@dataclass(frozen=True)
class Subject:
    """A rig and its frames."""

    folder: Path
    name: str
    scene: str
    rig: Rig
    frames: StoredFrames

    @staticmethod
    def built(part: str, results: Path) -> Subject:
        """The subject of a part in a folder of results."""
        name, scene = SUBJECTS[part]
        found = (results / name / "simulation" / scene).glob("frames-*.h5")
        chunks = sorted(found, key=lambda path: int(re.findall(r"\d+", path.stem)[-1]))
        return Subject(results / name, name, scene, Rig.load(results / name / "rig.h5"), StoredFrames(chunks))

    @cached_property
    def whole(self) -> TrainingSet:
        """All frames."""
        return TrainingSet.of(self.frames, self.scene)

    @cached_property
    def learned(self) -> TrainingSet:
        """The frames to learn from."""
        return self.whole.chosen(np.arange(len(self.whole) - len(self.whole) // TESTED))

    @cached_property
    def tested(self) -> TrainingSet:
        """The other frames."""
        return self.whole.chosen(np.arange(len(self.learned), len(self.whole)))

    @cached_property
    def hand(self) -> LearnedHand:
        """What is learned."""
        return learn(self.learned, self.rig, self.scene)

    def tested_frames(self, count: int) -> list[SimulatedFrame]:
        """The first of the tested frames as they were simulated."""
        return [self.frames[len(self.learned) + i] for i in range(count)]

    def layers(self) -> list[Layer]:
        """The layers that simulated the frames."""
        dataset = load_dataset(ROOT / f"config/datasets/{self.name}.yaml")
        needed = load_scene(ROOT / f"config/scenes/{self.scene}.yaml").needed
        below = paths.SUBJECT.format(subject=self.name)
        assert below.endswith(self.name)
        files = [self.folder / path for path in artifacts_of(needed, dataset)]
        return load_layers(needed, dataset, files, self.rig.surfaces)
