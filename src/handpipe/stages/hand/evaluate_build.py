"""Wall-clock time and peak memory of the whole build."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handpipe.core import metrics
from handpipe.evaluation import build_metrics, read_jobs
from handpipe.stages.files import Files


@dataclass(frozen=True)
class Inputs(Files):
    """What the stage reads."""

    report: Path


def evaluate_build(inputs: Inputs, output: Path, jobs: Path) -> None:
    """Wall-clock time and peak memory of the whole build."""
    metrics.write(output, build_metrics(read_jobs(jobs)))
