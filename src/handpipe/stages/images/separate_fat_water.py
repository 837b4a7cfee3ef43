"""Fat and water of a pose from gradient echoes, as images on the grid of its volume."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import metrics
from handpipe.core.configuration import Dataset
from handpipe.imaging.fat_water import read_echoes, separate
from handpipe.imaging.volumes import write_volume
from handpipe.stages.files import Files

log = logging.getLogger(__name__)
MUCH = 0.15  # of the tissue's energy, unexplained by fat and water


@dataclass(frozen=True)
class Outputs(Files):
    """What the stage writes."""

    water: Path
    fat: Path
    field: Path
    metrics: Path


def separate_fat_water(outputs: Outputs, dataset: Dataset, pose: str) -> None:
    """Fat and water of a pose from gradient echoes, as images on the grid of its volume."""
    figures: metrics.Metrics = {}
    with metrics.measured(figures):
        images = read_echoes(dataset, pose)
        found = separate(images)
        for path, values in (
            (outputs.water, found.water),
            (outputs.fat, found.fat),
            (outputs.field, found.field),
        ):
            write_volume(path, images.grid.like(values))
    if found.residual > MUCH:
        log.warning(
            "%s: fat and water leave %.0f %% of the energy (limit %.0f %%): check times, field_T and phase",
            *(pose, 100 * found.residual, 100 * MUCH),
        )
    fatty = found.fat[found.tissue] > found.water[found.tissue]
    figures |= {
        "fatty_share": (float(np.mean(fatty)), "1"),
        "field_median": (float(np.median(found.field[found.tissue])), "Hz"),
        "motion": (found.motion, "mm"),
        "residual": (found.residual, "1"),
        "exchange_margin": (found.margin, "1"),
        "may_be_exchanged": (float(found.doubtful), "1"),
    }
    metrics.write(outputs.metrics, figures)
