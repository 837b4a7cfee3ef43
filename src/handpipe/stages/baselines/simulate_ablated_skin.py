"""The skin of a scanned pose by a variant of the full model, with and without strains of the fat."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.hand import read_frames, write_frames
from handpipe.stages.baselines.variants import PASSIVE, VARIANTS
from handpipe.stages.files import Files
from handpipe.tissues.fat import load_fat


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    inner: Path
    fat: Path
    strains: Path


def simulate_ablated_skin(inputs: Inputs, output: Path, variant: str) -> None:
    """The skin of a scanned pose by a variant of the full model, with and without strains of the fat.

    Starts and tolerances are those of the full model; as there, a skin that cannot be kept out of itself is
    compared nevertheless.
    """
    [(frame, below)] = read_frames(inputs.inner)
    fat = VARIANTS[variant].changed(load_fat([inputs.fat, inputs.strains], {}).lenient())
    models = {variant: fat, f"{variant}{PASSIVE}": fat.without_strains()}
    skins = {name: layer.solve(frame, below) for name, layer in models.items()}
    write_frames(output, [(frame, skins)], inputs.all())
