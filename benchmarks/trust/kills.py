"""A build that is killed again and again and goes on with the same command, against one left alone."""

from __future__ import annotations

import logging
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handpipe.core import Metrics, artifacts

CHECKOUT = Path(__file__).parents[2]
FINGER = ("-j2", "all", "--configfile=config/finger.yaml")
KILLS = 20
LEAST = 4.0  # s until the first job of a build starts
# Kinds of writers by the end of what they write; each is killed once between its writing and its renaming.
WRITERS = (".h5", ".json", ".nii.gz", ".ply", ".nc", ".glb", ".vtu", ".pvd", ".html")
# What tells of time and memory, which no two builds share.
OF_COSTS = ("logs/", "benchmarks/", "metrics/", "report.html")
# Python reads a module of this name at its start.
HOOK = """
import os, signal, sys
from pathlib import Path

MARKS = Path({marks!r})
replace = os.replace


def killed_before_renaming(source, target, **options):
    path = Path(target).absolute()
    for mark in MARKS.iterdir() if path.is_relative_to(Path.cwd() / "results") else ():
        if path.name.endswith(mark.name):
            mark.unlink()
            os.killpg(os.getpgid(0), signal.SIGKILL)
    return replace(source, target, **options)


os.replace = killed_before_renaming
"""
log = logging.getLogger(__name__)


@dataclass
class Disturbed:
    """A build in a folder, whose processes are killed.

    marks: a folder with a file for each kind of writer that has not been killed yet.
    """

    folder: Path
    arguments: Sequence[str]
    marks: Path
    rng: np.random.Generator
    at_random: int = 0
    in_writers: list[str] = field(default_factory=list)

    @property
    def kills(self) -> int:
        return self.at_random + len(self.in_writers)

    def run(self, longest: float, kills: int) -> None:
        """Build to the end, killed at least so often, at random moments up to `longest` s after a start."""
        while True:
            before = {mark.name for mark in self.marks.iterdir()}
            wait = self.rng.uniform(LEAST, longest) if self.at_random < kills - len(WRITERS) else None
            process = started(self.folder, self.arguments, self.marks)
            try:
                code: int | None = process.wait(wait)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                code, self.at_random = None, self.at_random + 1
                log.info("killed after %.1f s", wait)
            gone = before - {mark.name for mark in self.marks.iterdir()}
            self.in_writers += sorted(gone)
            if gone:
                log.info("killed in the writer of %s", ", ".join(sorted(gone)))
            if code == 0 and self.kills >= kills:
                return
            if code == 0:  # too quick for the moments that were drawn: once more from the beginning
                shutil.rmtree(self.folder / "results")
            elif code is not None and not gone:
                raise RuntimeError(f"the build ended with code {code}; see {self.folder}/build.log")


def started(folder: Path, arguments: Sequence[str], marks: Path | None = None) -> subprocess.Popen[bytes]:
    """A build in a process group of its own; what it says goes to build.log."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    if marks is not None:
        inherited = environment.get("PYTHONPATH")
        environment["PYTHONPATH"] = os.pathsep.join([str(folder / "hook"), *filter(None, [inherited])])
    with open(folder / "build.log", "ab") as file:
        return subprocess.Popen(
            [sys.executable, "-m", "snakemake", *arguments],
            cwd=folder,
            env=environment,
            stdout=file,
            stderr=file,
            start_new_session=True,
        )


def working_copy(folder: Path) -> Path:
    """A folder with the workflow and its configuration, where nothing is built."""
    for part in ("workflow", "config", "profiles"):
        shutil.copytree(CHECKOUT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(CHECKOUT / "Snakefile", folder)
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    """All that a build wrote by its path, temporary files too, but for what tells of its costs."""
    base = folder / "results"
    found = {}
    for path in sorted(p for p in base.rglob("*") if p.is_file() and p.name != ".snakemake_timestamp"):
        inside = path.relative_to(base).as_posix().partition("/")[2]
        if not inside.startswith(OF_COSTS):
            found[path.relative_to(base).as_posix()] = content(path)
    return found


def content(path: Path) -> bytes:
    """Bytes of a file; the hash of an artifact's data, for it also records the commit of the code."""
    if path.suffix != ".h5" or path.name.startswith("."):
        return path.read_bytes()
    recorded = artifacts.read_attributes(path)
    artifacts.read(path, recorded["kind"])  # which checks the hash
    return str(recorded["data_hash"]).encode()


def mismatches(folder: Path, other: Path) -> list[str]:
    """Files that one build has and the other one lacks or has with another content."""
    found, expected = contents(folder), contents(other)
    return sorted(p for p in found.keys() | expected.keys() if found.get(p) != expected.get(p))


def disturb(folder: Path, arguments: Sequence[str] = FINGER, kills: int = KILLS, seed: int = 0) -> Metrics:
    """Build twice in `folder`, once with kills; count them and the files that differ at the end."""
    alone, disturbed = working_copy(folder / "alone"), working_copy(folder / "disturbed")
    start = time.monotonic()
    code = started(alone, arguments).wait()
    if code != 0:
        raise RuntimeError(f"the undisturbed build ended with code {code}; see {alone}/build.log")
    seconds = time.monotonic() - start
    marks = disturbed / "marks"
    marks.mkdir()
    for ending in WRITERS:
        (marks / ending).touch()
    (disturbed / "hook").mkdir()
    hook = HOOK.replace("{marks!r}", repr(str(marks)))
    (disturbed / "hook" / "sitecustomize.py").write_text(hook, encoding="utf-8")
    build = Disturbed(disturbed, arguments, marks, np.random.default_rng(seed))
    build.run(max(2 * seconds / kills, 3 * LEAST), kills)
    different = mismatches(disturbed, alone)
    for path in different:
        log.info("differs from the undisturbed build: %s", path)
    return {
        "kills": (build.kills, "1"),
        "kills_in_writers": (len(build.in_writers), "1"),
        "kill_mismatches": (len(different), "1"),
    }


def measure(results: Path) -> Metrics:
    """`kills`: how often a whole build of the finger was killed; `kill_mismatches`: files that differ."""
    with tempfile.TemporaryDirectory() as name:
        return disturb(Path(name))
