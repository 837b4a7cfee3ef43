"""What the figures were measured on: the machine, the libraries, the threads, and how busy it was."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numba
import numpy as np
import psutil

from handpipe.fem.linear.system_sequence import SystemSequence

Figure = Mapping[str, object]  # value and unit
Figures = dict[str, Figure]

LIBRARIES = ("handpipe", "numpy", "scipy", "numba", "mkl", "scikit-fem", "pypardiso", "pyamg")
REPEATS = 3


def figure(value: float | None, unit: str, reason: str | None = None) -> Figure:
    """A figure as the results file holds it; one that could not be measured has no value, but a reason."""
    return {"value": value, "unit": unit} | ({"reason": reason} if reason else {})


def facts() -> Figures:
    """`machine_…`: processor, cores, memory, versions, threads, and the load at the time."""
    load = os.getloadavg()
    found: Figures = {
        "machine_processor": {"value": _processor(), "unit": "text"},
        "machine_cores": figure(psutil.cpu_count(logical=False), "1"),
        "machine_logical_cores": figure(os.cpu_count(), "1"),
        "machine_memory": figure(psutil.virtual_memory().total / 2**30, "GiB"),
        "machine_system": {"value": f"{platform.system()} {platform.machine()}", "unit": "text"},
        "machine_threads": figure(numba.get_num_threads(), "1"),
        "machine_load_1min": figure(load[0], "1"),
        "machine_load_15min": figure(load[2], "1"),
        "machine_date": {"value": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), "unit": "text"},
        "version_python": {"value": platform.python_version(), "unit": "text"},
    }
    return found | {f"version_{name}": {"value": _version(name), "unit": "text"} for name in LIBRARIES}


def peak_memory() -> float:
    """Of this process in GiB. The system's usage counts, at first, what the process had that started it."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return float(status["VmHWM"].split()[0]) / 2**20


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor()


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def median_seconds(work: Callable[[], object], repeats: int = REPEATS) -> float:
    """Median of the seconds that `work` takes."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return float(np.median(times))


@dataclass
class LinearWatch:
    """What the linear solver did while it was watched: seconds in all of it, and by kind of work."""

    seconds: float = 0.0
    sequences: list[SystemSequence] = field(default_factory=list)

    @property
    def factorisations(self) -> int:
        return sum(sequence.factorisations for sequence in self.sequences)

    @property
    def cg_iterations(self) -> int:
        return sum(sequence.cg_iterations for sequence in self.sequences)

    def by_kind(self, kind: str) -> float:
        """Seconds of "factorise" or "solve"."""
        return sum(sequence.work.seconds[kind] for sequence in self.sequences)


@contextmanager
def watched() -> Iterator[LinearWatch]:
    """Watch every `SystemSequence.solve` of the block: factorisations, back substitutions, iterations."""
    watch = LinearWatch()
    original = SystemSequence.solve

    def timed(self, *arguments, **named):  # type: ignore[no-untyped-def]
        if not any(sequence is self for sequence in watch.sequences):
            watch.sequences.append(self)
        begun = time.perf_counter()
        try:
            return original(self, *arguments, **named)
        finally:
            watch.seconds += time.perf_counter() - begun

    SystemSequence.solve = timed  # type: ignore[method-assign]
    try:
        yield watch
    finally:
        SystemSequence.solve = original  # type: ignore[method-assign]
