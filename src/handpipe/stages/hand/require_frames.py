"""The end of a build: fails with the names of failed frames; the next build simulates these again."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import HandpipeError, write_text
from handpipe.hand import failures_in
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    chunks: Sequence[Path]
    made: Sequence[Path]


def require_frames(inputs: Inputs, output: Path, scenes: Sequence[str]) -> None:
    """The end of a build: fails with the names of failed frames; the next build simulates these again."""
    failed = [str(failure) for chunk in inputs.chunks for failure in failures_in(chunk)]
    if failed:
        raise HandpipeError(
            f"{len(failed)} frames were not simulated: {'; '.join(failed)} "
            "The exports and the report stand without them. Change or remove these frames, or build again"
        )
    write_text(output, json.dumps({"scenes": scenes}) + "\n")
