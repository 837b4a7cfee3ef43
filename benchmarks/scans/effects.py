"""Bones of the generated finger under each effect of real images, alone and together."""

from __future__ import annotations

from pathlib import Path

from benchmarks.images import rows
from handpipe.core import Metrics


def measure(_: Path) -> Metrics:
    """Figures of the rows at the usual and at the coarse voxel size."""
    rows.measure("compiles", "", rows.Setting(spacing=rows.COARSE))
    fine = [rows.measure(*setting) for setting in rows.settings()]
    coarse = [rows.measure(*setting) for setting in rows.settings(rows.COARSE)]
    return rows.figures(fine, coarse)
