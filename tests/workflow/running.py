"""A copy of the workflow to run, so that a test neither sees nor changes the checkout's own results."""

import atexit
import functools
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
TOY = "--configfile=config/finger.yaml"  # what is built where nothing else is named
CORES = "--cores=2"
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
    return [sys.executable, "-m", "snakemake", TOY, CORES, *arguments]


def watching(folder: Path) -> dict[str, str]:
    """Variables for `run`: each job writes into the folder what it read (tests/workflow/watch)."""
    places = [str(Path(__file__).with_name("watch")), ENVIRONMENT.get("PYTHONPATH", "")]
    return {"WATCHED": str(folder), "PYTHONPATH": os.pathsep.join(filter(None, places))}


def run(
    folder: Path, *arguments: str, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """Snakemake in a folder; what it says is in `stdout`, errors included.

    environment: variables beside those of `ENVIRONMENT`; with them, its libraries are imported anew.
    """
    if environment is None:
        return snakemake(folder, TOY, CORES, *arguments)
    return subprocess.run(
        command(arguments),
        cwd=folder,
        env={**ENVIRONMENT, **environment},
        encoding="utf-8",
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        check=False,
    )


def snakemake(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Snakemake in a folder with these arguments and no others, of a process that has its libraries."""
    server = _server(tuple(sorted(ENVIRONMENT.items())))
    assert server.stdin is not None and server.stdout is not None
    with tempfile.NamedTemporaryFile("r", encoding="utf-8") as said:
        call = {"folder": str(folder), "arguments": arguments, "said": said.name}
        server.stdin.write(json.dumps(call) + "\n")
        server.stdin.flush()
        status = int(server.stdout.readline())
        return subprocess.CompletedProcess(arguments, status, said.read())


@functools.cache
def _server(environment: tuple[tuple[str, str], ...]) -> subprocess.Popen[str]:
    """The process of `warm_snakemake` with an environment, which ends with this one."""
    server = subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("warm_snakemake.py"))],
        env=dict(environment),
        encoding="utf-8",
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    atexit.register(server.communicate)
    return server


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
