"""A scanned subject's files, before hours are spent on its images."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import artifacts
from handpipe.core.configuration import Dataset
from handpipe.hand import faults
from handpipe.stages.files import Files

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    files: Sequence[Path]


def check_subject(inputs: Inputs, output: Path, dataset: Dataset) -> None:
    """A scanned subject's files, before hours are spent on its images."""
    found = faults(dataset.name, dataset)
    for fault in found[1:]:
        log.error("%s", fault)
    if found:
        raise found[0]
    artifacts.write_text(output, json.dumps({"checked": [*map(str, inputs.all())]}, indent=2) + "\n")
