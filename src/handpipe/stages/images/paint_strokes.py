"""The strokes on a real limb's image as a label volume on its grid."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core.configuration import Dataset
from handpipe.imaging.segmentation import painted
from handpipe.imaging.volumes import write_labels
from handpipe.stages.files import Files
from handpipe.stages.images.prepare_image import build_scale


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    strokes: Path
    image: Path


def paint_strokes(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """The strokes on a real limb's image as a label volume on its grid."""
    seeds, affine = painted(inputs.strokes, inputs.image, dataset.labels)
    write_labels(output, seeds, build_scale(dataset) @ affine)
