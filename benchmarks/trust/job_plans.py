"""The jobs of a target and what Snakemake compares of each, without a build: what a change would rerun."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from snakemake.api import SnakemakeApi
from snakemake.settings.types import (
    ConfigSettings,
    DAGSettings,
    OutputSettings,
    Quietness,
    ResourceSettings,
)


class JobName(NamedTuple):
    rule: str
    wildcards: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class JobPlan:
    """compared: what Snakemake compares with the last run, its parameters and input files, by job;
    needs: the jobs of which a job takes files; costs: benchmark files of jobs that have one; threads: of two
    cores."""

    compared: Mapping[JobName, tuple[object, ...]]
    needs: Mapping[JobName, frozenset[JobName]]
    costs: Mapping[JobName, Path] = field(default_factory=dict)
    threads: Mapping[JobName, int] = field(default_factory=dict)

    def rules(self) -> set[str]:
        return {job.rule for job in self.compared}

    def changed(self, before: JobPlan) -> set[JobName]:
        """Jobs that rerun of themselves if `before` has been built."""
        return {job for job, found in self.compared.items() if before.compared.get(job) != found}

    def rerun(self, before: JobPlan) -> set[JobName]:
        """Jobs that rerun if `before` has been built, those behind changed ones too."""
        found, size = self.changed(before), -1
        while size != len(found):
            size = len(found)
            found |= {job for job, needs in self.needs.items() if needs & found}
        return found


def plan(folder: Path, targets: Sequence[str], config: Mapping[str, Any] | None = None) -> JobPlan:
    """All jobs of the targets in a working folder, none of them built.

    config: what `--config` would give on top of config/finger.yaml. Raises `WorkflowError` as Snakemake does.
    """
    files = [folder / "config" / name for name in ("config.yaml", "finger.yaml")]
    with warnings.catch_warnings(), SnakemakeApi(OutputSettings(quiet={Quietness.ALL})) as api:
        warnings.simplefilter("ignore")
        started = api.workflow(
            resource_settings=ResourceSettings(cores=2),
            config_settings=ConfigSettings(configfiles=files, config=dict(config or {})),
            workdir=folder,
            snakefile=folder / "Snakefile",
        )
        graph = started.dag(dag_settings=DAGSettings(targets=set(targets), forceall=True))
        graph.execute_workflow(executor="dryrun")
        dag = started._workflow.dag  # Snakemake has no public way to it
        names = {job: JobName(job.rule.name, tuple(sorted(job.wildcards_dict.items()))) for job in dag.jobs}
        kept = dag.workflow.persistence
        return JobPlan(
            {name: (*kept._params(job), None, *kept._input(job)) for job, name in names.items()},
            {name: frozenset(names[d] for d in dag.dependencies[job]) for job, name in names.items()},
            {name: Path(job.benchmark) for job, name in names.items() if job.benchmark},
            {name: job.threads for job, name in names.items()},
        )
