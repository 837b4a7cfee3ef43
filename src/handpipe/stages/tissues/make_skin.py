"""The neutral skin from its scan, with nails and the cut end: for the fat and the soft tissue."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core.configuration import Dataset
from handpipe.hand import CarriedTemplate
from handpipe.mesh.files import read_scan, read_surface
from handpipe.stages.files import Files
from handpipe.tissues.fat import Rigid, Skin, closed_skin, cut_ends, nail_vertices, on_skin

log = logging.getLogger(__name__)
NAIL, CUT = 0.4, 1.0  # mm from a nail's patch, and from the plane of the cut


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    scan: Path
    nails: Sequence[Path]
    carried: Path | None = None
    from_volume: Path | None = None


def make_skin(inputs: Inputs, output: Path, dataset: Dataset, edge: float) -> None:
    """The neutral skin from its scan, with nails and the cut end: for the fat and the soft tissue."""
    scan = read_scan(inputs.scan)
    skin, notes = closed_skin(scan, edge)
    for note in notes:
        log.info("neutral scan: %s", note)
    if inputs.carried is None:
        patches = {name: read_surface(dataset.path(nail.surface)) for name, nail in dataset.nails.items()}
    else:
        patches = dict(CarriedTemplate.load(inputs.carried).nails)
    if inputs.carried is not None or inputs.from_volume is not None:
        patches = {name: on_skin(patch, skin) for name, patch in patches.items()}
    parts = {
        name: Rigid(nail.bone, nail_vertices(skin, patches[name], tolerance=NAIL))
        for name, nail in dataset.nails.items()
    }
    ends = cut_ends(skin, scan, tolerance=CUT)
    if len(ends) > 1:
        middles = "; ".join(", ".join(f"{c:.0f}" for c in skin.vertices[end].mean(axis=0)) for end in ends)
        text = (
            "the neutral scan has %d large openings, near (%s) mm: each is taken for a cut of the limb, "
            "where the skin goes with the root bone; if one is a hole of the scan, close it in the scan"
        )
        log.warning(text, len(ends), middles)
    parts["cut_end"] = Rigid(dataset.root_bone, np.concatenate([np.zeros(0, dtype=np.int64), *ends]))
    rigid = {name: part for name, part in parts.items() if len(part.vertices)}
    log.info("%d vertices, rigid parts: %s", len(skin.vertices), ", ".join(rigid))
    Skin(skin, rigid).save(output, [inputs.scan])
