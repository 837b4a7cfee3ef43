"""How far a subject's build is, and how long the rest takes by the costs of earlier jobs."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean

from handpipe.core import paths
from handpipe.evaluation import read_jobs

TYPICAL = Path(__file__).with_name("typical_seconds.json")  # python -m benchmarks.cluster.typical


@dataclass(frozen=True)
class RuleJobs:
    """The jobs of one rule.

    Parameters
    ----------
    rule : str
        Its name.
    done, left : int
        Numbers of jobs.
    seconds : float or None
        Mean duration in s of such a job in earlier builds, or of the generated hand where there was none;
        None where that has no such job.
    typical : bool
        Whether that is the generated hand's.
    """

    rule: str
    done: int
    left: int
    seconds: float | None
    typical: bool = False

    @property
    def seconds_left(self) -> float:
        """Time in s of the jobs that are to do, one after the other; 0 where nothing is known."""
        return self.left * (self.seconds or 0.0)


def stages(left: Mapping[str, int], whole: Mapping[str, int], subject: str) -> list[RuleJobs]:
    """The state of each rule of a build.

    Parameters
    ----------
    left, whole : mapping of str to int
        Jobs of each rule that are to do, and of a whole build.
    subject : str
        Whose earlier jobs tell how long one takes; those of other subjects where it has none, and the
        generated hand's at `fidelity: preview` where they have none.

    Returns
    -------
    list of RuleJobs
        In the order of `whole`.
    """
    found = []
    for rule, count in whole.items():
        measured, to_do = _seconds(rule, subject), left.get(rule, 0)
        seconds = _typical_seconds().get(rule) if measured is None else measured
        typical = measured is None and seconds is not None
        found.append(RuleJobs(rule, max(count - to_do, 0), to_do, seconds, typical))
    return found


def _seconds(rule: str, subject: str) -> float | None:
    for folder in _cost_folders(subject):
        if jobs := read_jobs(folder, rule):
            return fmean(job.seconds for job in jobs)
    return None


@cache
def _typical_seconds() -> dict[str, float]:
    """Seconds a job of the generated hand, by rule."""
    seconds: dict[str, float] = json.loads(TYPICAL.read_text(encoding="utf-8"))["seconds"]
    return seconds


def _cost_folders(subject: str) -> Iterator[Path]:
    """Folders of the costs of jobs: the subject's own first."""
    own = paths.at(paths.COSTS, subject=subject)
    yield own
    yield from sorted(f for f in Path(paths.RESULTS).glob(f"*/{own.name}") if f != own)


def duration(seconds: float) -> str:
    """A time in words, as exact as an estimate is."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    if seconds < 90 * 60:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h"
