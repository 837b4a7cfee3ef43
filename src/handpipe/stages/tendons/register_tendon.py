"""A tendon's rod in a pose: simulated, then fitted to its dark tube in the image (Zheng 2022 §5.3)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import artifacts
from handpipe.core.configuration import Dataset
from handpipe.imaging.evidence import tube_surface
from handpipe.imaging.volumes import pose_volume
from handpipe.mesh.surfaces import Distance, concatenate, each_moved
from handpipe.skeleton.bones import read_registration
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.poses import doubted_bones
from handpipe.tissues.tendons.fitting import TendonTarget, centre_finder, register
from handpipe.tissues.tendons.rods import RestTendon

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    volume: Path
    neutral: Path
    registration: Path


def register_tendon(inputs: Inputs, output: Path, dataset: Dataset, name: str, pose: str) -> None:
    """A tendon's rod in a pose: simulated, then fitted to its dark tube in the image (Zheng 2022 §5.3)."""
    tendon = dataset.tendons[name]
    rig = Rig.load(inputs.rig)
    neutral = artifacts.read(inputs.neutral, "neutral_tendon")
    volume = pose_volume(dataset, pose)
    transforms = read_registration(inputs.registration, tendon.bones)
    for bone, doubt in doubted_bones(inputs.registration, tendon.bones).items():
        log.warning("%s in %s is in doubt: it follows %s, and %s", name, pose, bone, doubt)
    surfaces = {b: rig.surfaces[b] for b in tendon.bones}
    bones = Distance(concatenate([*each_moved(surfaces, transforms).values()]))
    radius = float(neutral["radii"].mean())
    rest = RestTendon.build(neutral["x"], neutral["radii"], surfaces)

    def target(x: np.ndarray) -> TendonTarget:
        return TendonTarget(
            Distance(tube_surface(volume, x, radius, bones)), lambda points: bones.signed(points)[0]
        )

    find_centres = centre_finder(volume, radius, bones)
    found = register(rest, {b: transforms[b] for b in tendon.bones}, find_centres, target)
    data = {"x": found.x, "twist": found.twist, "rough": found.rough, "centred": found.centred}
    units = dict.fromkeys(("x", "rough", "centred"), "mm")
    artifacts.write(output, data, kind="posed_tendon", units=units, inputs=inputs.all())
