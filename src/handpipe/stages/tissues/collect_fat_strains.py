"""The fat's strains and nail corrections over the poses, neutral (none) among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import RigidTransform, artifacts
from handpipe.core.configuration import Dataset, Interpolation
from handpipe.skeleton.posing import LocalPoseSpaces
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.fat import FatStrains, Tissue


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    mesh: Path
    poses: Sequence[Path]


def collect_fat_strains(inputs: Inputs, output: Path, dataset: Dataset, interpolation: Interpolation) -> None:
    """The fat's strains and nail corrections over the poses, neutral (none) among them."""
    rig = Rig.load(inputs.rig)
    fits = [artifacts.read(path, "fat_fit") for path in inputs.poses]
    transforms = {dataset.neutral: dict.fromkeys(rig.bones, RigidTransform.identity())}
    transforms |= {pose: rig.scanned_bones(pose) for pose in dataset.examples}
    spaces = LocalPoseSpaces.build(rig.bones, rig.parents, transforms, interpolation)
    tissue = Tissue.load(inputs.mesh)
    logs = np.stack([np.zeros((len(tissue.mesh.tets), 6)), *(f["log_strains"] for f in fits)])
    corrected = fits[0].get("nails", {}) if fits else {}
    nails = {name: np.stack([np.zeros(6), *(f["nails"][name] for f in fits)]) for name in corrected}
    found = [tissue.shifts(transforms[p], f["vertices"]) for p, f in zip(dataset.examples, fits, strict=True)]
    shifts = np.stack([np.zeros_like(tissue.mesh.vertices), *found])
    FatStrains(spaces, logs, nails, shifts).save(output, inputs.all())
