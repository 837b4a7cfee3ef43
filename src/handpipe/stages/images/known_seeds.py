"""The seeds of a pose, with what its label map holds in place of strokes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from handpipe.core.configuration import Dataset
from handpipe.imaging.segmentation import with_labelled
from handpipe.imaging.volumes import Labels, Volume, read_labels
from handpipe.mesh.surfaces import Surface


def known_seeds(
    path: Path | None, volume: Volume, dataset: Dataset, labelled: Mapping[str, Surface]
) -> Labels:
    """Seeds (nx, ny, nz) of a pose; none without a file but those of the bones of its label map."""
    known = dataset.seed_labels
    seeds = np.zeros(volume.shape, np.uint8) if path is None else read_labels(path, volume, known)
    return with_labelled(volume, seeds, {known[name]: surface for name, surface in labelled.items()})
