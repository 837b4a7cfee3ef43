"""Jobs with measured lengths on a number of workers: when the last one ends, and how early it could end."""

from __future__ import annotations

import heapq
from collections import defaultdict
from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from graphlib import TopologicalSorter


@dataclass(frozen=True)
class Work:
    """seconds: length of each job by its name, in the order in which they are submitted; needs: the jobs that
    a job waits for, none where it has no entry."""

    seconds: Mapping[str, float]
    needs: Mapping[str, Set[str]] = field(default_factory=dict)

    def order(self) -> list[str]:
        """Jobs, each behind those that it needs; `graphlib.CycleError` if jobs wait for one another."""
        return list(TopologicalSorter({job: self.needs.get(job, ()) for job in self.seconds}).static_order())


@dataclass(frozen=True)
class Costs:
    """What a cluster adds to a job, in s.

    start: a worker is busy for this long before the job itself begins, since Snakemake starts anew for it;
    notice: jobs that wait for it start this much later, since Snakemake asks for finished jobs in intervals.
    """

    start: float = 0.0
    notice: float = 0.0


def makespan(work: Work, workers: int, costs: Costs) -> float:
    """Seconds until the last job ends; a free worker takes the job that has been ready for the longest time.

    The queue does not know the jobs' lengths, as Slurm does not.
    """
    place = {job: i for i, job in enumerate(work.seconds)}
    missing = {job: len(work.needs.get(job, ())) for job in work.seconds}
    behind = _behind(work)
    ready = [(0.0, place[job], job) for job in work.seconds if not missing[job]]
    events: list[tuple[float, int, bool, str]] = []  # when, of which place, whether it is known, of which job
    now, last, free = 0.0, 0.0, workers
    while ready or events:
        while ready and free:
            _, _, job = heapq.heappop(ready)
            free -= 1
            heapq.heappush(events, (now + costs.start + work.seconds[job], place[job], False, job))
        now, _, known, job = heapq.heappop(events)
        if not known:
            last, free = now, free + 1
            heapq.heappush(events, (now + costs.notice, place[job], True, job))
            continue
        for later in behind[job]:
            missing[later] -= 1
            if not missing[later]:
                heapq.heappush(ready, (now, place[later], later))
    return last


def least(work: Work, workers: int, costs: Costs) -> float:
    """Seconds that no order of the jobs falls below: the longest chain of needs, or all work shared."""
    together = sum(work.seconds.values()) + costs.start * len(work.seconds)
    return max(longest_chain(work, costs), together / workers)


def longest_chain(work: Work, costs: Costs) -> float:
    """Seconds of the longest chain of jobs that wait for one another."""
    end: dict[str, float] = {}
    for job in work.order():
        begin = max((end[need] + costs.notice for need in work.needs.get(job, ())), default=0.0)
        end[job] = begin + costs.start + work.seconds[job]
    return max(end.values(), default=0.0)


def _behind(work: Work) -> Mapping[str, list[str]]:
    """The jobs that wait for a job."""
    found: dict[str, list[str]] = defaultdict(list)
    for job in work.seconds:
        for need in work.needs.get(job, ()):
            found[need].append(job)
    return found
