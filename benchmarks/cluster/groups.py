"""Jobs that a profile submits together: Snakemake's keys `groups` and `group-components`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import yaml
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchmarks.cluster.schedule import Work


@dataclass(frozen=True)
class Groups:
    """of_rule: group by rule; components: how many connected parts of a group's jobs are one submission."""

    of_rule: Mapping[str, str]
    components: Mapping[str, int]

    @classmethod
    def read(cls, profile: Path) -> Groups:
        """What a profile says, the file `config.yaml` of its folder."""
        content = yaml.safe_load((profile / "config.yaml").read_text(encoding="utf-8"))
        pairs = [[line.split("=") for line in content.get(key, ())] for key in ("groups", "group-components")]
        return cls(dict(pairs[0]), {name: int(count) for name, count in pairs[1]})

    def of_job(self, job: str) -> str | None:
        """The group of a job with the name `{rule}/…`."""
        return self.of_rule.get(job.partition("/")[0])


def submissions(work: Work, groups: Groups) -> list[tuple[str, ...]]:
    """Jobs that are submitted together, each job in one submission."""
    found: list[tuple[str, ...]] = [(job,) for job in work.seconds if groups.of_job(job) is None]
    for group in dict.fromkeys(groups.of_rule.values()):
        jobs = [job for job in work.seconds if groups.of_job(job) == group]
        parts = _connected(jobs, work.needs)
        count = groups.components.get(group, 1)
        found += [tuple(chain(*parts[i : i + count])) for i in range(0, len(parts), count)]
    return found


def grouped(work: Work, groups: Groups) -> Work:
    """The submissions as jobs, each named by its first job; the jobs of one run one after the other."""
    parts = submissions(work, groups)
    name = {job: part[0] for part in parts for job in part}
    needs = {
        part[0]: frozenset(name[need] for job in part for need in work.needs.get(job, ())) - {part[0]}
        for part in parts
    }
    return Work({part[0]: sum(work.seconds[job] for job in part) for part in parts}, needs)


def _connected(jobs: Sequence[str], needs: Mapping[str, Iterable[str]]) -> list[tuple[str, ...]]:
    """Parts of the jobs that needs connect."""
    if not jobs:
        return []
    place = {job: i for i, job in enumerate(jobs)}
    edges = [(place[job], place[need]) for job in jobs for need in needs.get(job, ()) if need in place]
    pairs = np.array(edges, dtype=int).reshape(-1, 2).T
    graph = coo_array((np.ones(len(edges)), pairs), shape=(len(jobs), len(jobs)))
    found: dict[int, list[str]] = defaultdict(list)
    for job, part in zip(jobs, connected_components(graph, directed=False)[1], strict=True):
        found[part].append(job)
    return [tuple(part) for part in found.values()]
