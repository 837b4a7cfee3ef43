"""`python -m benchmarks.cluster.measured RESULTS`: lengths of jobs and frames of a built hand.

They are kept beside this file, with the commit of the build, so that clusters can be simulated without it.
Which job needs which is read from the workflow as it is now: it has to have the jobs of that build.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.cluster.schedule import Work
from benchmarks.trust.job_plans import JobPlan
from benchmarks.trust.poses import CHUNKS
from benchmarks.trust.stale import workbench
from handpipe.core import artifacts, paths
from handpipe.develop.results import build_commit
from handpipe.develop.tables import layer_seconds
from handpipe.evaluation import read_jobs

SUBJECT, SCENE = "phantom-hand-preview", "hand-preview"
KEPT = Path(__file__).with_name("measured.json")


@dataclass(frozen=True)
class Measured:
    """Lengths in s by the clock.

    jobs: of a whole build, by name `{rule}/{wildcards}`; needs: the jobs whose files a job reads, without
    those that follow from others; loading: of a job of frames without its frames, mean; frames: of runs of
    neighbouring frames of the benchmark of trust, by name.
    """

    commit: str
    jobs: Mapping[str, float]
    needs: Mapping[str, Sequence[str]]
    loading: float
    frames: Mapping[str, Sequence[float]]

    @classmethod
    def read(cls, path: Path = KEPT) -> Measured:
        return cls(**json.loads(path.read_text(encoding="utf-8")))

    def build(self) -> Work:
        """The whole build."""
        return Work(self.jobs, {job: frozenset(needs) for job, needs in self.needs.items()})

    def rules(self) -> dict[str, list[float]]:
        """Lengths of the jobs of each rule."""
        found: dict[str, list[float]] = {}
        for job, seconds in self.jobs.items():
            found.setdefault(job.partition("/")[0], []).append(seconds)
        return found


def measure(results: Path) -> Measured:
    """Read the figures of a built hand and of its frames in the benchmark of trust."""
    subject = results / SUBJECT
    seconds = {f"{job.rule}/{job.name}": round(job.seconds, 2) for job in read_jobs(subject / "benchmarks")}
    logged = layer_seconds(subject / "logs" / "simulate" / SCENE)
    of_frames = [sum(layers.values()) for layers in logged.values()]
    of_jobs = [seconds[job] for job in seconds if job.startswith("simulate/")]
    with workbench() as bench:
        needs = direct_needs(bench.plan(SUBJECT, scenes=[SCENE]))
    frames = results / "benchmarks" / "trust" / "frames"
    return Measured(
        commit=build_commit([subject])[:7],
        jobs={job: seconds[job] for job in needs},
        needs=needs,
        loading=round(float(np.sum(of_jobs) - np.sum(of_frames)) / len(of_jobs), 2),
        frames={chunk: np.load(frames / f"{chunk}.npz")["seconds"].round(2).tolist() for chunk in CHUNKS},
    )


def direct_needs(of: JobPlan) -> dict[str, list[str]]:
    """Jobs with benchmark files, each behind those that it needs, without needs that follow from others."""
    folder = Path(paths.at(paths.COSTS, subject=SUBJECT))
    names = {job: path.relative_to(folder).with_suffix("").as_posix() for job, path in of.costs.items()}
    needs = {name: {names[need] for need in of.needs[job]} for job, name in names.items()}
    order = Work(dict.fromkeys(needs, 0.0), needs).order()
    before: dict[str, set[str]] = {}
    for job in order:
        before[job] = needs[job].union(*(before[need] for need in needs[job]))
    return {job: sorted(needs[job].difference(*(before[need] for need in needs[job]))) for job in order}


def main(arguments: Sequence[str] | None = None) -> None:
    """Write what was measured."""
    parser = argparse.ArgumentParser(prog="benchmarks.cluster.measured", description=__doc__)
    parser.add_argument("results", type=Path, help="folder `results` of a build, beside its workflow")
    parser.add_argument("--output", type=Path, default=KEPT, help="JSON to be written")
    options = parser.parse_args(arguments)
    artifacts.write_text(options.output, json.dumps(asdict(measure(options.results)), indent=0) + "\n")


if __name__ == "__main__":
    main()
