"""A tendon's neutral rod and tube from the volume and a clicked curve."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts
from handpipe.core.configuration import Dataset
from handpipe.hand import CarriedTemplate
from handpipe.imaging.evidence import read_markers
from handpipe.imaging.volumes import pose_volume
from handpipe.mesh.surfaces import Distance, concatenate
from handpipe.skeleton.rig import Rig
from handpipe.stages.files import Files
from handpipe.tissues.tendons.fitting import extract, extract_roughly

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    rig: Path
    volume: Path
    path: Path | None
    carried: Path | None = None


def extract_tendon(inputs: Inputs, output: Path, dataset: Dataset, name: str, edge: float) -> None:
    """A tendon's neutral rod and tube from the volume and a clicked curve."""
    tendon = dataset.tendons[name]
    rig = Rig.load(inputs.rig)
    bones = Distance(concatenate([rig.surfaces[b] for b in tendon.bones]))
    volume = pose_volume(dataset, dataset.neutral)
    if inputs.carried is None:
        clicked, _ = read_markers(dataset.path(tendon.path))
        found = extract(volume, clicked, tendon.radius, bones, edge)
    else:
        path = CarriedTemplate.load(inputs.carried).paths[name]
        found = extract_roughly(volume, path, tendon.radius, bones, edge)
    log.info("%d segments, radius %.2f mm", len(found.x) - 1, found.radii.mean())
    data = {
        "x": found.x,
        "radii": found.radii,
        "confidence": found.confidence,
        "tube": {"vertices": found.surface.vertices, "triangles": found.surface.triangles},
    }
    units = dict.fromkeys(("x", "radii", "tube/vertices"), "mm")
    artifacts.write(output, data, kind="neutral_tendon", units=units, inputs=inputs.all())
