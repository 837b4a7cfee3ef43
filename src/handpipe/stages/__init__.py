"""The stages of a build: one function a stage, files in and files out, which rules and people call.

A stage takes a record of its input files (`Inputs`), a record of its output files (`Outputs`) or the path of
its only one, the subject's dataset, and settings. No stage knows Snakemake. A room exports its
stages as modules: a rule depends on the code of its own stage alone.
"""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages import (
        costs,
        files,
        hand,
        images,
        levels,
        muscles,
        poses,
        skeleton,
        skin_distances,
        synthetic,
        tendons,
        tissues,
        truth,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "costs",
    "files",
    "hand",
    "images",
    "levels",
    "muscles",
    "poses",
    "skeleton",
    "skin_distances",
    "synthetic",
    "tendons",
    "tissues",
    "truth",
]
