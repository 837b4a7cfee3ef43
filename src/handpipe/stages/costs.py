"""What the jobs of a stage cost, as figures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from handpipe.core import Metrics
from handpipe.evaluation import Job, read_jobs


def jobs_in(folders: Iterable[Path]) -> list[Job]:
    """The jobs of some rules; folders: one a rule, with the benchmark files of its jobs."""
    return [job for folder in folders for job in read_jobs(folder.parent, folder.name)]


def stage_cost(folders: Iterable[Path]) -> Metrics:
    """`seconds` (sum over jobs, s) and `peak_memory` (largest job, GiB) of some rules."""
    jobs = jobs_in(folders)
    return {
        "seconds": (sum(j.seconds for j in jobs), "s"),
        "peak_memory": (max((j.peak_memory for j in jobs), default=0.0), "GiB"),
    }


def pose_cost(folders: Iterable[Path], poses: Iterable[str]) -> Metrics:
    """`seconds_per_pose`, mean, and `seconds_per_pose_max`: the jobs of a pose, one after the other."""
    jobs = jobs_in(folders)
    seconds = [sum(j.seconds for j in jobs if j.name.split("/")[0] == pose) for pose in poses]
    return {
        "seconds_per_pose": (sum(seconds) / len(seconds), "s"),
        "seconds_per_pose_max": (max(seconds), "s"),
    }


def contact_figures(settled: Sequence[dict[str, float]], prefix: str = "") -> Metrics:
    """Most renewals of contact planes, largest motion that was left, and how many frames did not settle.

    settled: figures of the layer in each frame (`handpipe.fem.solver.Settled.figures`).
    """
    return {
        f"{prefix}contact_renewals_max": (max(f["contact_renewals"] for f in settled), "1"),
        f"{prefix}contact_motion_max": (max(f["contact_motion"] for f in settled), "mm"),
        f"{prefix}contact_unsettled": (sum(f["contact_unsettled"] for f in settled), "1"),
    }
