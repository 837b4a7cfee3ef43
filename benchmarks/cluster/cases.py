"""What is simulated: frames of sequences, and a whole build, on growing numbers of workers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.cluster.groups import Groups, grouped
from benchmarks.cluster.measured import Measured
from benchmarks.cluster.schedule import Costs, Work, least, makespan
from handpipe.core import Metrics

WORKERS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
PERFORMANCE, ALL_FIVE = 653, 2873  # frames of Zheng 2022 Table 3: hand tracking; all sequences
TEN_TIMES = 10 * ALL_FIVE  # the sequences of ten hands
CHUNK = 12  # frames in a job of the shipped motions
SEED = 0


@dataclass(frozen=True)
class Case:
    """Jobs on a cluster; useful: seconds without what the cluster adds and, of frames, loading."""

    name: str
    text: str
    work: Work
    useful: float


def cases(measured: Measured, groups: Groups) -> list[Case]:
    """All cases."""
    build = measured.build()
    useful = sum(build.seconds.values())
    return [
        _frames(measured, PERFORMANCE, CHUNK),
        _frames(measured, PERFORMANCE, 4),
        _frames(measured, PERFORMANCE, 1),
        _frames(measured, ALL_FIVE, 1),
        _frames(measured, TEN_TIMES, 1),
        _frames(measured, PERFORMANCE, 1, outside=True),
        Case("build", "whole build, jobs alone", build, useful),
        Case("build_grouped", "whole build, in groups", grouped(build, groups), useful),
    ]


def _frames(measured: Measured, count: int, chunk: int, outside: bool = False) -> Case:
    seconds = sequence(measured, count, outside)
    poses = ", any pose" if outside else ""
    text = f"{count:,} frames, {chunk} a job{poses}"
    name = f"frames{count}_chunk{chunk}{'_any' if outside else ''}"
    return Case(name, text, jobs_of(seconds, chunk, measured.loading), sum(seconds))


def sequence(measured: Measured, count: int, outside: bool = False) -> list[float]:
    """Seconds of frames: measured runs of neighbouring frames, drawn with replacement; the seed is fixed.

    outside: whether poses far outside the scans are drawn, too.
    """
    runs = [seconds for name, seconds in measured.frames.items() if outside or not name.startswith("outside")]
    rng, found = np.random.default_rng(SEED), list[float]()
    while len(found) < count:
        found += runs[rng.integers(len(runs))]
    return found[:count]


def jobs_of(seconds: Sequence[float], chunk: int, loading: float) -> Work:
    """A job for each `chunk` frames; `loading`: seconds of a job before and behind its frames."""
    starts = range(0, len(seconds), chunk)
    return Work({f"simulate/{i // chunk}": loading + sum(seconds[i : i + chunk]) for i in starts})


def figures(case: Case, costs: Costs) -> Metrics:
    """Jobs, and by number of workers: seconds, the least possible, gain over one worker, and the useful share
    of the workers' time."""
    found: Metrics = {f"{case.name}_jobs": (len(case.work.seconds), "1")}
    alone = makespan(case.work, 1, costs)
    for workers in WORKERS:
        name, seconds = f"{case.name}_workers{workers}", makespan(case.work, workers, costs)
        found |= {
            f"{name}_seconds": (seconds, "s"),
            f"{name}_seconds_least": (least(case.work, workers, costs), "s"),
            f"{name}_speedup": (alone / seconds, "1"),
            f"{name}_share": (case.useful / workers / seconds, "1"),
        }
    return found
