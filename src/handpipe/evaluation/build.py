"""Time, memory and warnings of a build, from the benchmark files that Snakemake writes and the jobs' logs."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import Metrics
from handpipe.evaluation.table import Cell, Table

MIB_PER_GIB = 1024.0  # MiB in a GiB
ALL = "all"  # name of the only job of a rule, see `paths.log_of`
WARNED = re.compile(r"[\d:]+ WARNING \S+: (.+)")  # a line of a log; what it says


@dataclass(frozen=True)
class Job:
    """One job of a build.

    Parameters
    ----------
    rule : str
        Name of its rule.
    seconds, cpu_seconds : float
        Duration by the clock, and time of processors, in s.
    peak_memory : float
        Largest memory in GiB.
    end : float
        End in s since the epoch.
    name : str
        What its rule's wildcards say of it, as "fist" or "fist/distal2".
    """

    rule: str
    seconds: float
    cpu_seconds: float
    peak_memory: float
    end: float
    name: str = ""


def read_jobs(folder: str | Path, rule: str | None = None) -> list[Job]:
    """Jobs of a build, from the benchmark files of Snakemake.

    A file of several repetitions counts each. Figures that Snakemake could not take ("NA", "-") count as 0.

    Parameters
    ----------
    folder : path
        Folder with the files `{rule}/….tsv` or `{rule}.tsv`. A file's own time is taken as its job's end.
    rule : str, optional
        Rule whose folder `{rule}` is read; by default all rules.

    Returns
    -------
    list of Job
        Jobs in the order of the files' paths.
    """
    folder = Path(folder)
    jobs = []
    for path in sorted((folder / rule if rule else folder).rglob("*.tsv")):
        name, *rest = path.relative_to(folder).with_suffix("").parts
        with open(path, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file, delimiter="\t"):
                seconds, cpu = _number(row.get("s")), _number(row.get("cpu_time"))
                memory = _number(row.get("max_rss")) / MIB_PER_GIB
                jobs.append(Job(name, seconds, cpu, memory, path.stat().st_mtime, "/".join(rest)))
    return jobs


def read_warnings(folder: str | Path) -> dict[str, list[str]]:
    """What jobs of a build warned of, from their logs.

    Parameters
    ----------
    folder : path
        Folder with the files `{rule}/….log`.

    Returns
    -------
    dict of str to list of str
        Sentences by rule, in the order of the files; after the name of the job if the rule has several.
    """
    folder = Path(folder)
    found: dict[str, list[str]] = {}
    for path in sorted(folder.rglob("*.log")):
        rule, *rest = path.relative_to(folder).with_suffix("").parts
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        job = "" if rest == [ALL] else f"{'/'.join(rest)}: "
        said = [f"{job}{line[1]}" for line in map(WARNED.fullmatch, lines) if line]
        if said:
            found.setdefault(rule, []).extend(said)
    return found


def build_metrics(jobs: Sequence[Job], start: float | None = None, end: float | None = None) -> Metrics:
    """Figures of a build for build.json.

    `wall_seconds` runs from `start` to `end`; `busy_seconds` leaves out the times when no job ran (a build
    resumed the next day); `cpu_seconds` and `job_seconds` sum over jobs; `peak_memory` is the largest of one
    job. `{rule}.…` holds the same by rule.

    Parameters
    ----------
    jobs : sequence of Job
        Jobs of the build.
    start, end : float, optional
        Times in s since the epoch; by default the first start and the last end of a job.

    Returns
    -------
    Metrics
        Value and unit by name; without jobs only their number.
    """
    if not jobs:
        return {"jobs": (0, "1")}
    first = min(job.end - job.seconds for job in jobs) if start is None else start
    last = max(job.end for job in jobs) if end is None else end
    metrics: Metrics = {"wall_seconds": (last - first, "s"), "busy_seconds": (_busy(jobs), "s")}
    metrics |= _totals("", jobs)
    for rule in sorted({job.rule for job in jobs}):
        metrics |= _totals(f"{rule}.", [job for job in jobs if job.rule == rule])
    return metrics


def cost_table(jobs: Sequence[Job]) -> Table | None:
    """Jobs, time and peak memory by rule, in descending order of time; None without jobs."""
    if not jobs:
        return None
    rules = {rule: _totals("", [j for j in jobs if j.rule == rule]) for rule in {j.rule for j in jobs}}
    keys = ("jobs", "job_seconds", "longest_seconds", "cpu_seconds", "peak_memory")
    ordered = sorted(rules.items(), key=lambda item: (-item[1]["job_seconds"][0], item[0]))
    total = ("all", _totals("", jobs))
    rows: list[list[Cell]] = [
        [rule, str(int(t["jobs"][0])), *(t[key][0] for key in keys[1:])] for rule, t in (*ordered, total)
    ]
    columns = [
        "rule",
        "jobs",
        "sum of jobs [s]",
        "longest job [s]",
        "processor time [s]",
        "peak memory [GiB]",
    ]
    return Table("Time and memory by rule.", columns, rows, "From Snakemake's benchmark files.")


def _totals(prefix: str, jobs: Sequence[Job]) -> Metrics:
    return {
        f"{prefix}jobs": (len(jobs), "1"),
        f"{prefix}job_seconds": (sum(job.seconds for job in jobs), "s"),
        f"{prefix}longest_seconds": (max(job.seconds for job in jobs), "s"),
        f"{prefix}cpu_seconds": (sum(job.cpu_seconds for job in jobs), "s"),
        f"{prefix}peak_memory": (max(job.peak_memory for job in jobs), "GiB"),
    }


def _busy(jobs: Sequence[Job]) -> float:
    """Length of the union of the jobs' intervals."""
    total, reached = 0.0, float("-inf")
    for begin, end in sorted((job.end - job.seconds, job.end) for job in jobs):
        total += max(end - max(begin, reached), 0.0)
        reached = max(reached, end)
    return total


def _number(text: str | None) -> float:
    try:
        return float(text or 0)
    except ValueError:
        return 0.0
