"""The skin of one scanned pose by three models (000 Table 4): full, no fat strains, one soft tissue."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.hand.frames import read_frames, write_frames
from handpipe.stages.files import Files
from handpipe.stages.poses import fat_layer, soft_tissue_layer


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    inner: Path
    fat: Path
    strains: Path
    soft_tissue: Path


def simulate_skin(inputs: Inputs, output: Path) -> None:
    """The skin of one scanned pose by three models (000 Table 4): full, no fat strains, one soft tissue."""
    base = f"results/{snakemake.wildcards.subject}"
    [(frame, below)] = read_frames(inputs.inner)
    models = {"m0": fat_layer(base), "m1": fat_layer(base, strains=False), "m2": soft_tissue_layer(base)}
    skins = {name: layer.solve(frame, below) for name, layer in models.items()}
    write_frames(output, [(frame, skins)], inputs.all())
