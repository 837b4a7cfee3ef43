"""Which organs of a run are right, by the phantom's truth; of which of the others the library said something.

Bones are judged where their marrow is imaged: chemical shift moves all fat along the readout, in every pose
alike, which no segmentation can tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.bones.errors import motion_error, overlap
from benchmarks.bones.subject import Scan
from benchmarks.images.chain.stages import Chain
from benchmarks.images.chain.subject import posed
from handpipe.core import Array, RigidTransform, artifacts
from handpipe.evaluation import surface_distance
from handpipe.imaging.volumes import read_volume
from handpipe.mesh.files import read_scan
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones import read_registrations, read_surfaces
from handpipe.stages.muscles.muscle_files import read_bodies
from handpipe.tissues.tendons.fitting import centreline_errors

DICE = 0.93  # of a whole bone in neutral, as in docs/hard-cases-bones.md
TURN, SHIFT = 1.0, 0.3  # deg, and mm of the centroid: of a registered bone
DEVIATIONS = 3.0  # stated standard deviations within which an error is expected
LINE = 0.5  # mm, mean, of a tendon's centreline in a pose
MUSCLE = 0.5  # mm, mean, of a muscle's surface in a pose
SKIN = 0.3  # mm, mean, of the skin of the neutral volume


@dataclass(frozen=True)
class Error:
    """One figure of an organ in a pose against truth.

    kind: Dice, or what is apart; value: None where the organ was not found; stated: standard deviation that
    the registration states of it in the report, in the same unit.
    """

    organ: str
    pose: str
    kind: str
    value: float | None
    bar: float
    stated: float | None = None

    @property
    def wrong(self) -> bool:
        """Whether it is not found, or on the wrong side of the bar."""
        if self.value is None:
            return True
        return self.value < self.bar if self.kind == "Dice" else self.value > self.bar

    @property
    def expected(self) -> bool:
        """Whether what the registration states of itself covers it."""
        known = self.value is not None and self.stated is not None
        return known and self.value <= DEVIATIONS * self.stated  # type: ignore[operator]

    def __str__(self) -> str:
        if self.value is None:
            return f"{self.organ} in {self.pose}: not found"
        unit = {"Dice": "", "turn": " deg"}.get(self.kind, " mm")
        return f"{self.organ} in {self.pose}: {self.kind} {self.value:.2f}{unit}"


def errors(chain: Chain, displacement: float) -> list[Error]:
    """Every figure of a run; displacement: of the imaged marrow along the readout in mm."""
    return [
        *_bones(chain, displacement),
        *_tendons(chain),
        *_muscles(chain),
        *_skin(chain),
    ]


def _bones(chain: Chain, displacement: float) -> Iterator[Error]:
    data, moved = chain.dataset, np.array([displacement, 0.0, 0.0])
    path = chain.file(data.neutral, "surfaces.h5")
    whole = read_surfaces(path, "whole") if path.exists() else {}
    for bone in data.bones:
        value = _dice(chain, bone, whole[bone], moved) if bone in whole else None
        yield Error(bone, data.neutral, "Dice", value, DICE)
    if not whole:
        return
    shift = RigidTransform(np.eye(3), moved)
    for pose in data.examples:
        path = chain.file(pose, "registration.h5")
        found = read_registrations(path) if path.exists() else {}
        for bone in data.bones:
            if bone not in found:
                yield Error(bone, pose, "turn", None, TURN)
                continue
            true = shift @ posed(pose).transforms[bone] @ shift.inverse()
            centroid = posed(data.neutral).bones[bone][0].mean(axis=0) + moved
            turn, apart = motion_error(found[bone].transform, true, centroid)
            stated = found[bone].rotation_deviation, found[bone].translation_deviation
            yield Error(bone, pose, "turn", turn, TURN, stated[0])
            yield Error(bone, pose, "shift", apart, SHIFT, stated[1])


def _dice(chain: Chain, bone: str, found: Surface, moved: Array) -> float:
    data = chain.dataset
    volume = read_volume(data.path(data.poses[data.neutral].volume))
    vertices, triangles = posed(data.neutral).bones[bone]
    scan = Scan(volume, np.zeros(0, np.uint8), posed(data.neutral), data.labels)
    return overlap(found, (vertices + moved, triangles), scan)


def _tendons(chain: Chain) -> Iterator[Error]:
    data = chain.dataset
    for name in data.tendons:
        for pose in (data.neutral, *data.examples[:1]):
            path = chain.file(pose, f"{name}.h5")
            value = None
            if path.exists():
                kind = "neutral_tendon" if pose == data.neutral else "posed_tendon"
                apart = centreline_errors(artifacts.read(path, kind)["x"], posed(pose).tendons[name])
                value = float(np.concatenate(apart).mean())
            yield Error(name, pose, "centreline", value, LINE)


def _muscles(chain: Chain) -> Iterator[Error]:
    data = chain.dataset
    neutral, shapes = (chain.file("muscles", f"{name}.h5") for name in ("neutral", "shapes"))
    bodies = read_bodies(neutral) if neutral.exists() else {}
    shaped = artifacts.read(shapes, "muscle_shapes") if shapes.exists() else {}
    for name in data.muscles:
        for pose in (data.neutral, *data.examples[:1]):
            value = None
            if name in bodies and (pose == data.neutral or pose in shaped):
                surface = bodies[name].surface
                if pose != data.neutral:
                    surface = surface.moved(shaped[pose][name]["vertices"])
                value = _apart(surface, Surface(*posed(pose).muscles[name]))
            yield Error(name, pose, "muscle", value, MUSCLE)


def _skin(chain: Chain) -> Iterator[Error]:
    neutral = chain.dataset.neutral
    path = chain.file(neutral, "skin.ply")
    value = None
    if path.exists():
        true = Surface(*posed(neutral).skin)
        value = float(surface_distance(read_scan(path).vertices, true).mean())
    yield Error("skin", neutral, "skin", value, SKIN)


def _apart(found: Surface, truth: Surface) -> float:
    """Mean distance in mm between two surfaces, from the vertices of each."""
    both = (surface_distance(found.vertices, truth), surface_distance(truth.vertices, found))
    return float(np.concatenate(both).mean())
