"""The whole chain on one finger under each effect of real images: bones, tendons, muscles, skin."""

from __future__ import annotations

from pathlib import Path

from benchmarks.images.chain import rows
from handpipe.core import Metrics


def measure(results: Path) -> Metrics:
    """Figures of the rows, and of the sweep of voxels and noise; a run that was broken off goes on."""
    kept = rows.file_in(results / "benchmarks")
    found = rows.figures([*rows.measured(rows.cases(), kept)])
    return found | rows.sweep_figures([*rows.measured(rows.sweep(), kept)])
