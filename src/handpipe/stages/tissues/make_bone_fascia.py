"""The cloth around the bones, and the constraint of each of its vertices."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.skeleton.posing import bone_regions
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.fascia import ClothSettings, Fascia, bone_wrap, read_regions

log = logging.getLogger(__name__)
JOINT_RADIUS, TOLERANCE = 5.0, 1.0  # mm around a joint, and off a bone, where the membrane is not fixed
SHRINK = 0.35  # rest size over true size


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    regions: Path | None


def make_bone_fascia(inputs: Inputs, output: Path, dataset: Dataset, edge: float) -> None:
    """The cloth around the bones, and the constraint of each of its vertices."""
    bones = Rig.load(inputs.rig).surfaces
    joints = [(j.parent, j.child) for j in dataset.joints.values()]
    surface = bone_wrap(bones, joints, edge)
    regions = bone_regions(surface.vertices, bones, joint_radius=JOINT_RADIUS, tolerance=TOLERANCE)
    if painted := inputs.regions:
        regions = read_regions(painted, len(surface.vertices))
    log.info("%d vertices, %d of them fixed", len(regions), (regions > 0).sum())
    cloth = ClothSettings(shrink=SHRINK)
    Fascia.around("bone_fascia", surface, regions, bones, cloth).save(output, inputs.all())
