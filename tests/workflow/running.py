"""A copy of the workflow to run, so that a test neither sees nor changes the checkout's own results."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
TOY = "--configfile=config/finger.yaml"  # what is built where nothing else is named
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}


def working_copy(folder: Path) -> Path:
    """A folder with the workflow and its configuration, where nothing is built."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(CHECKOUT / "Snakefile", folder)
    for part in ("workflow", "config", "profiles"):
        ignore = shutil.ignore_patterns("__pycache__")
        shutil.copytree(CHECKOUT / part, folder / part, dirs_exist_ok=True, ignore=ignore)
    return folder


def command(arguments: Sequence[str]) -> list[str]:
    """The command line of a build, of the toy unless the arguments say otherwise."""
    return [sys.executable, "-m", "snakemake", TOY, *arguments]


def watching(folder: Path) -> dict[str, str]:
    """Variables for `run`: each job writes into the folder what it read (tests/workflow/watch)."""
    places = [str(Path(__file__).with_name("watch")), ENVIRONMENT.get("PYTHONPATH", "")]
    return {"WATCHED": str(folder), "PYTHONPATH": os.pathsep.join(filter(None, places))}


def run(
    folder: Path, *arguments: str, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Snakemake in a folder; what it says is in `stdout`, errors included.

    environment: variables beside those of `ENVIRONMENT`.
    """
    return subprocess.run(
        command(arguments),
        cwd=folder,
        env={**ENVIRONMENT, **(environment or {})},
        encoding="utf-8",
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )


def planned(folder: Path, *arguments: str) -> dict[str, int]:
    """Rules that a dry run would execute, and how often."""
    process = run(folder, *arguments, "-n", "--quiet", "rules")
    assert process.returncode == 0, process.stdout
    return job_counts(process.stdout)


def job_counts(said: str) -> dict[str, int]:
    """The table "job count" of what Snakemake said."""
    counts = {}
    for line in said.splitlines():
        words = line.split()
        if len(words) == 2 and words[1].isdigit() and words[0] != "total":
            counts[words[0]] = int(words[1])
    return counts
