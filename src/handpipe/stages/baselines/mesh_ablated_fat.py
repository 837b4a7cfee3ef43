"""The fat of a variant that differs in what it lies on, or in how it is constrained."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.stages.baselines.variants import VARIANTS
from handpipe.stages.files import Files
from handpipe.stages.tissues import mesh_fat
from handpipe.tissues.fat import Tissue


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    skin: Path
    fat: Path


def mesh_ablated_fat(inputs: Inputs, output: Path, edge: float, variant: str) -> None:
    """The fat of a variant that differs in what it lies on, or in how it is constrained; edge in mm."""
    chosen = VARIANTS[variant]
    full = Tissue.load(inputs.fat)
    changed = chosen.changed(full)
    if changed is not full:
        changed.save(output, inputs.all())
        return
    given = mesh_fat.Inputs(rig=inputs.rig, inner=inputs.inner, skin=inputs.skin)
    mesh_fat.mesh_fat(given, output, edge, chosen.under_fat)
