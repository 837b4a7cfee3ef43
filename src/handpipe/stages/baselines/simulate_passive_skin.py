"""The skin of a scanned pose without plastic strains: the full model without them, and one tissue."""

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


def simulate_passive_skin(inputs: Inputs, output: Path) -> None:
    """The skin of a scanned pose by m1 and m2 of Zheng 2022 Table 4: no strains in the fat, one tissue.

    A skin that cannot be kept out of itself is compared nevertheless; its figures tell.
    """
    [(frame, below)] = read_frames(inputs.inner)
    passive = load_fat([inputs.fat, inputs.strains], {}).without_strains()
    models = {"m1": passive.lenient(), "m2": load_skin([inputs.soft_tissue], {}).lenient()}
    skins = {name: layer.solve(frame, below) for name, layer in models.items()}
    write_frames(output, [(frame, skins)], inputs.all())
