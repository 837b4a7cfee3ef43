"""Runs of the workflow, each a process of its own: all that the command knows of Snakemake."""

from __future__ import annotations

import base64
import fcntl
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from handpipe.core import HandpipeError, InputError

LOCK = Path(".snakemake/handpipe.lock")
UNFINISHED = Path(".snakemake/incomplete")


@dataclass(frozen=True)
class Build:
    """What is asked of the workflow.

    Parameters
    ----------
    subject : str
        Name of a dataset file.
    scenes : sequence of str
        Names of scene files; those of the configuration where there are none.
    configuration : path, optional
        Configuration file that overrides the default one.
    target : str
        Stage to build up to.
    """

    subject: str
    scenes: Sequence[str] = ()
    configuration: Path | None = None
    target: str = "all"

    def arguments(self) -> list[str]:
        """Arguments of Snakemake."""
        chosen = [f"subjects=[{self.subject}]"]
        if self.scenes:
            chosen.append(f"scenes=[{','.join(self.scenes)}]")
        files = ["--configfile", str(self.configuration)] if self.configuration else []
        return [self.target, *files, "--config", *chosen]


def require_project() -> None:
    """Raise `InputError` where the working folder has no workflow."""
    if not Path("Snakefile").is_file():
        problem = f"there is none in {Path.cwd()}"
        raise InputError("Snakefile", "folder", problem, "Change to the folder of the project first")


def run(build: Build, cores: int) -> int:
    """Build; what the workflow says goes to the terminal.

    Parameters
    ----------
    build : Build
        What to build.
    cores : int
        Jobs at a time.

    Returns
    -------
    int
        Exit code of the workflow: 0 where all is built.
    """
    return subprocess.run(_command([*build.arguments(), "--cores", str(cores)]), check=False).returncode


def job_counts(build: Build) -> tuple[dict[str, int], dict[str, int]]:
    """Number of jobs of each rule that are to do, and of a whole build from nothing.

    Raises
    ------
    HandpipeError
        With what the workflow says, where it cannot be planned.
    """
    asked = [*build.arguments(), "--dry-run", "--quiet", "rules"]
    processes = [
        subprocess.Popen(
            _command([*asked, *forced]), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8"
        )
        for forced in ([], ["--forceall"])
    ]
    said = [process.communicate()[0] for process in processes]
    for process, text in zip(processes, said, strict=True):
        if process.returncode != 0:
            raise HandpipeError(_problem(text))
    left, whole = map(_table, said)
    for jobs in (left, whole):
        jobs.pop(build.target, None)  # a name for its files, and no work
    return left, whole


def is_running() -> bool:
    """Whether a build runs in this folder: it holds the lock that workflow/helpers/build.smk takes."""
    if not LOCK.is_file():
        return False
    with LOCK.open("r+") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return True
    return False


def unfinished_files() -> list[str]:
    """Paths that jobs write at present, or wrote when a build was killed."""
    names = [path.relative_to(UNFINISHED) for path in UNFINISHED.rglob("*") if path.is_file()]
    coded = ["".join(part.removeprefix("@") for part in name.parts) for name in names]
    return sorted(base64.b64decode(code, b"-_").decode() for code in coded)


def _command(arguments: Sequence[str]) -> list[str]:
    return [sys.executable, "-m", "snakemake", *arguments]


def _table(said: str) -> dict[str, int]:
    """The table "job count" of what Snakemake said."""
    rows = [line.split() for line in said.splitlines()]
    return {row[0]: int(row[1]) for row in rows if len(row) == 2 and row[1].isdigit() and row[0] != "total"}


def _problem(said: str) -> str:
    """The line of a failed run that a person is to read."""
    lines = said.strip().splitlines()
    ours = [line.partition("handpipe: ")[2] for line in lines if "handpipe: " in line]
    return ours[-1] if ours else next(reversed(lines), "the workflow cannot be planned")
