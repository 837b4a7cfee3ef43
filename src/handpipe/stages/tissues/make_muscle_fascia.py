"""The cloth around the muscles, and the constraint of each of its vertices."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.stages.files import Files
from handpipe.tissues.fascia import ClothSettings, Fascia, muscle_regions, read_regions, wrap
from handpipe.tissues.muscles import Muscle

log = logging.getLogger(__name__)
ATTACHED, GAP = 2.0, 0.8  # mm from an attachment, and off a muscle
SHRINK = 0.40  # rest size over true size


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    muscles: Sequence[Path]
    regions: Path | None


def make_muscle_fascia(inputs: Inputs, output: Path, edge: float) -> None:
    """The cloth around the muscles, and the constraint of each of its vertices."""
    muscles = [Muscle.load(path) for path in inputs.muscles]
    surfaces = {m.name: m.body.surface for m in muscles}
    surface = wrap(list(surfaces.values()), edge)
    attached = np.concatenate([m.body.surface.vertices[m.body.attached_vertices] for m in muscles])
    regions = muscle_regions(surface.vertices, surfaces, attached, attached_radius=ATTACHED, gap=GAP)
    if painted := inputs.regions:
        regions = read_regions(painted, len(surface.vertices))
    log.info("%d vertices; contact, sliding, fixed: %s", len(regions), np.bincount(regions, minlength=3))
    cloth = ClothSettings(shrink=SHRINK)
    Fascia.around("muscle_fascia", surface, regions, surfaces, cloth).save(output, inputs.all())
