"""The skin of a scanned pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.hand import read_frames, write_frames
from handpipe.stages.files import Files
from handpipe.tissues.fat import load_fat


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    fat: Path
    strains: Path


def simulate_skin(inputs: Inputs, output: Path) -> None:
    """The skin of a scanned pose by the full model (m0 of Zheng 2022 Table 4).

    A skin that cannot be kept out of itself is compared with the scan nevertheless; its figures tell.
    """
    [(frame, below)] = read_frames(inputs.inner)
    fat = load_fat([inputs.fat, inputs.strains], {}).lenient()
    write_frames(output, [(frame, {"m0": fat.solve(frame, below)})], inputs.all())
