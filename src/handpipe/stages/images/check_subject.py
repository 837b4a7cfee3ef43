"""A scanned subject's files, before hours are spent on its images."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts
from handpipe.core.configuration import Dataset
from handpipe.hand import check_frames, check_images, check_surfaces
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    files: Sequence[Path]


def check_subject(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """A scanned subject's files, before hours are spent on its images."""
    check_surfaces(dataset)
    check_images(dataset)
    check_frames(dataset)
    artifacts.write_text(output, json.dumps({"checked": [*map(str, inputs.all())]}, indent=2) + "\n")
