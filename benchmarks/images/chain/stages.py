"""The stages from images to bones, tendons, muscles and skin, on files, as the workflow's jobs call them.

Bones are found in every pose, tendons and muscles in neutral and in the first example. Not run: what images
touch through these organs alone (hooks, separation of posed muscles, strains, fasciae, fat), ligaments, and
the flesh, which is one of several first guesses of muscles.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from benchmarks.bones.notices import listening
from benchmarks.images.chain.subject import changed
from handpipe.core.configuration import Dataset
from handpipe.stages.images import merge_labels, segment_pose
from handpipe.stages.muscles import extract_muscle, extract_muscle_shapes, place_templates, separate_neutral
from handpipe.stages.skeleton import fit_rig, register_bones
from handpipe.stages.tendons import extract_tendon, register_tendon
from handpipe.stages.tissues import extract_skin

SEGMENT = 1.2  # mm, of tendons' rods
OF_THE_VIEW = "the border of the image cuts"
EDGE = 2.5  # mm of muscles' tets, as in config/config.yaml


@dataclass(frozen=True)
class Word:
    """What the library said in a stage of some organs; ended: whether that was an error that ended it."""

    stage: str
    organs: list[str]
    text: str
    ended: bool = False

    def about(self) -> set[str]:
        """The organs that it is about: those that it names; one that ends a stage is about all of them else.

        Where the image ends is no word about the skin's place.
        """
        if OF_THE_VIEW in self.text:
            return set()
        named = {organ for organ in self.organs if organ in self.text}
        return named or set(self.organs if self.ended or len(self.organs) == 1 else ())


@dataclass
class Chain:
    """Files of a run in a folder, what was said, and the processor's seconds of each stage."""

    dataset: Dataset
    folder: Path
    said: list[Word] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    def file(self, kind: str, name: str) -> Path:
        """The file of an artifact."""
        path = self.folder / kind / name
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    @property
    def rig(self) -> Path:
        """The file of the rig."""
        return self.file("rig", "rig.h5")

    def run(self) -> None:
        """Every stage that has its inputs."""
        neutral, *others = [self.dataset.neutral, *self.dataset.examples]
        self._segment(neutral)
        if not self.file(neutral, "surfaces.h5").exists():
            return  # refused
        for pose in others:
            self._segment(pose)
        for pose in self.dataset.poses:
            self._register(pose)
        self._step("fit_rig", self.dataset.bones, self._fit_rig)
        if self.rig.exists():
            self._tendons(others[:1])
            self._muscles(others[:1])
            self._step("extract_skin", ["skin"], self._extract_skin)

    def _step(self, stage: str, organs: Iterable[str], run: Callable[[], None]) -> None:
        """Time a stage and listen; an error for people ends the stage alone."""
        heard: list[str] = []
        begun, finished = time.process_time(), False
        with listening(heard):
            run()
            finished = True
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.process_time() - begun
        last = len(heard) - 1
        self.said += [
            Word(stage, [*organs], text, not finished and number == last) for number, text in enumerate(heard)
        ]

    def _volume(self, pose: str) -> Path:
        return self.dataset.path(self.dataset.poses[pose].volume)

    def _segment(self, pose: str) -> None:
        data, files = self.dataset, self.dataset.poses[pose]
        assert files.seeds is not None
        volume, seeds, claims = self._volume(pose), data.path(files.seeds), self.file(pose, "bones.h5")
        given = segment_pose.Inputs(volume, seeds)
        self._step(
            "segment_pose", data.bones, lambda: segment_pose.segment_pose(given, claims, data, pose, ())
        )
        if not claims.exists():
            return
        looks = None if pose == data.neutral else self.file(data.neutral, "looks.json")
        inputs = merge_labels.Inputs(volume, seeds, claims, (), (), looks)
        names = ("labels.nii.gz", "labels.json", "surfaces.h5", "looks.json")
        outputs = merge_labels.Outputs(*(self.file(pose, name) for name in names))
        self._step("merge_labels", data.bones, lambda: merge_labels.merge_labels(inputs, outputs, data, pose))

    def _register(self, pose: str) -> None:
        neutral, target = (self.file(p, "surfaces.h5") for p in (self.dataset.neutral, pose))
        given, output = register_bones.Inputs(neutral, target), self.file(pose, "registration.h5")
        self._step(
            "register_bones",
            self.dataset.bones,
            lambda: register_bones.register_bones(given, output, self.dataset, pose),
        )

    def _fit_rig(self) -> None:
        registered = [self.file(pose, "registration.h5") for pose in self.dataset.poses]
        inputs = fit_rig.Inputs(self.file(self.dataset.neutral, "surfaces.h5"), registered, ())
        outputs = fit_rig.Outputs(
            self.rig, *(self.file("rig", f"{n}.json") for n in ("metrics", "table", "limits"))
        )
        fit_rig.fit_rig(inputs, outputs, self.dataset, True)

    def _tendons(self, poses: Iterable[str]) -> None:
        data = self.dataset
        for name, tendon in data.tendons.items():
            neutral = self.file(data.neutral, f"{name}.h5")
            given = extract_tendon.Inputs(self.rig, self._volume(data.neutral), data.path(tendon.path))

            extract = partial(extract_tendon.extract_tendon, given, neutral, data, name, SEGMENT)
            self._step("extract_tendon", [name], extract)
            for pose in poses if neutral.exists() else ():
                there = register_tendon.Inputs(
                    self.rig, self._volume(pose), neutral, self.file(pose, "registration.h5")
                )
                output = self.file(pose, f"{name}.h5")

                register = partial(register_tendon.register_tendon, there, output, data, name, pose)
                self._step("register_tendon", [name], register)

    def _muscles(self, poses: list[str]) -> None:
        data, placed = self.dataset, self.file("muscles", "placed.h5")
        templates = [data.path(b.template) for b in data.bones.values() if b.template is not None]
        templates += [data.path(p) for m in data.muscles.values() for p in (m.template, m.attachments)]
        given = place_templates.Inputs(self.rig, templates)
        self._step(
            "place_templates", data.muscles, lambda: place_templates.place_templates(given, placed, data)
        )
        if not placed.exists():
            return
        fitted = [self.file("muscles", f"{name}.h5") for name in data.muscles]
        for name, output in zip(data.muscles, fitted, strict=True):
            inputs = extract_muscle.Inputs(self.rig, placed, self._volume(data.neutral), None, None)

            extract = partial(extract_muscle.extract_muscle, inputs, output, data, name)
            self._step("extract_muscle", [name], extract)
        if not all(path.exists() for path in fitted):
            return
        neutral = self.file("muscles", "neutral.h5")
        bodies = separate_neutral.Inputs(self.rig, fitted)
        self._step(
            "separate_neutral",
            data.muscles,
            lambda: separate_neutral.separate_neutral(bodies, neutral, EDGE),
        )
        if neutral.exists():
            shapes = extract_muscle_shapes.Inputs(
                self.rig,
                neutral,
                [self._volume(pose) for pose in poses],
                [self.file(pose, "registration.h5") for pose in poses],
                (),
                (),
                (),
            )
            output = self.file("muscles", "shapes.h5")
            alone = changed(data, poses={p: data.poses[p] for p in (data.neutral, *poses)})
            self._step(
                "extract_muscle_shapes",
                data.muscles,
                lambda: extract_muscle_shapes.extract_muscle_shapes(shapes, output, alone),
            )

    def _extract_skin(self) -> None:
        neutral = self.dataset.neutral
        outputs = extract_skin.Outputs(self.file(neutral, "skin.ply"), self.file(neutral, "skin.json"))
        extract_skin.extract_skin(
            extract_skin.Inputs(self._volume(neutral), self.rig), outputs, self.dataset, neutral
        )
