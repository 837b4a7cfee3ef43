"""One soft tissue between the bones and the skin (Wang 2019 §5)."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.skeleton.posing import BoneLayer
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.stages.poses import scanned_frame
from handpipe.stages.tissues.tissue import Inside, make_tissue
from handpipe.tissues.fascia import bone_wrap
from handpipe.tissues.fat import Skin, TissueSettings

log = logging.getLogger(__name__)

# kPa (Wang 2019 §5.5): one tissue between fat and muscle; it does not change a free pose's shape.
YOUNG = 6.0


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    skin: Path


def mesh_soft_tissue(inputs: Inputs, output: Path, dataset: Dataset, edge: float) -> None:
    """One soft tissue between the bones and the skin (Wang 2019 §5)."""
    rig = Rig.load(inputs.rig)
    below = {"bones": BoneLayer(rig.surfaces).solve(scanned_frame(rig, dataset.neutral), {})}
    inner = bone_wrap(rig.surfaces, [(j.parent, j.child) for j in dataset.joints.values()], edge=1.5)
    skin = Skin.load(inputs.skin).with_ends(rig.surfaces)
    inside = Inside(below, ("bones",), inner, inputs.rig)
    tissue = make_tissue(rig, inside, skin, edge, TissueSettings(young=YOUNG, skin_young=YOUNG))
    tissue.save(output, inputs.all())
