"""The skin of a scanned pose by three models (Zheng 2022 Table 4): full, no fat strains, one tissue."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.hand import read_frames, write_frames
from handpipe.stages.files import Files
from handpipe.tissues.fat import load_fat, load_skin


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    fat: Path
    strains: Path
    soft_tissue: Path


def simulate_skin(inputs: Inputs, output: Path) -> None:
    """The skin of a scanned pose by three models (Zheng 2022 Table 4): full, no fat strains, one tissue.

    A model whose skin cannot be kept out of itself is compared nevertheless; its figures tell.
    """
    [(frame, below)] = read_frames(inputs.inner)
    fat = load_fat([inputs.fat, inputs.strains], {}).lenient()
    models = {"m0": fat, "m1": fat.without_strains(), "m2": load_skin([inputs.soft_tissue], {}).lenient()}
    skins = {name: layer.solve(frame, below) for name, layer in models.items()}
    write_frames(output, [(frame, skins)], inputs.all())
