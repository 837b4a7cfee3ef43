"""Muscles of an example pose without interpenetration (Zheng 2022 §4.4, stage 2)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts
from handpipe.mesh.surfaces import each_moved
from handpipe.skeleton.bones import read_registration
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.muscles.muscle_files import read_bodies
from handpipe.tissues.muscles.separation import separate_posed

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    registration: Path
    neutral: Path
    shapes: Path


def separate_muscles(inputs: Inputs, output: Path, pose: str) -> None:
    """Muscles of an example pose without interpenetration (Zheng 2022 §4.4, stage 2)."""
    shapes = artifacts.read(inputs.shapes, "muscle_shapes")[pose]
    bones = Rig.load(inputs.rig).surfaces
    bodies = {n: b.on_bones(bones) for n, b in read_bodies(inputs.neutral).items()}
    transforms = read_registration(inputs.registration, bones)
    posed = {n: b.posed(shapes[n]["vertices"], transforms) for n, b in bodies.items()}
    found = separate_posed(posed, each_moved(bones, transforms))
    log.info("penetration %.3f mm before, %.3f mm after", found.penetration_before, found.penetration)
    found.save(output, inputs.all())
