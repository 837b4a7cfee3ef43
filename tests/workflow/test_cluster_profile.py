"""What Snakemake submits to a cluster by `profiles/slurm`, in a dry run of the whole hand."""

import re
from collections import Counter
from pathlib import Path

from benchmarks.cluster.__main__ import PROFILE
from benchmarks.cluster.groups import Groups, submissions
from benchmarks.cluster.measured import SCENE, SUBJECT, Measured

from .running import run, working_copy


def test_snakemake_submits_the_groups_that_are_simulated(tmp_path: Path) -> None:
    groups = Groups.read(PROFILE)
    parts = [groups.of_job(part[0]) for part in submissions(Measured.read().build(), groups)]
    config = ("--config", f"subjects=[{SUBJECT}]", f"scenes=[{SCENE}]")
    process = run(working_copy(tmp_path), "--profile=profiles/slurm", "-n", "all", *config)
    assert process.returncode == 0, process.stdout
    assert Counter(re.findall(r"Group job (\w+)", process.stdout)) == Counter(filter(None, parts))
    alone = re.findall(r"^Job \d+: ", process.stdout, re.MULTILINE)  # of groups they are indented
    assert len(alone) == parts.count(None)
