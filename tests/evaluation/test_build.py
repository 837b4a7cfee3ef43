"""Benchmark files as Snakemake writes them, and logs as jobs do."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from handpipe.evaluation.build import build_metrics, cost_table, read_jobs, read_warnings

HEAD = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"


def benchmark(path: Path, seconds: float, rss: str, cpu: str, end: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(HEAD + f"{seconds}\t0:00:01\t{rss}\t1\t1\t1\t0\t0\t99\t{cpu}\n")
    os.utime(path, (end, end))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    benchmark(tmp_path / "correct_bone" / "fist" / "distal2.tsv", 10, "512", "9", end=1010)
    benchmark(tmp_path / "correct_bone" / "fist" / "middle2.tsv", 8, "1024", "7.5", end=1012)
    benchmark(tmp_path / "fit_rig" / "all.tsv", 5, "NA", "-", end=1100)
    return tmp_path


def test_span_busy_time_sums_and_peaks(folder: Path):
    metrics = build_metrics(read_jobs(folder))
    assert metrics["wall_seconds"] == (pytest.approx(100), "s")
    assert metrics["busy_seconds"] == (pytest.approx(12 + 5), "s")
    assert metrics["cpu_seconds"] == (pytest.approx(16.5), "s")
    assert metrics["peak_memory"] == (pytest.approx(1.0), "GiB")
    assert metrics["jobs"] == (3, "1")
    assert metrics["correct_bone.job_seconds"] == (pytest.approx(18), "s")
    assert metrics["fit_rig.peak_memory"] == (0, "GiB")


def test_given_times_set_the_span(folder: Path):
    assert build_metrics(read_jobs(folder), start=990, end=1200)["wall_seconds"] == (210, "s")


def test_costliest_rule_comes_first(folder: Path):
    made = cost_table(read_jobs(folder))
    assert made is not None
    assert [row[:3] for row in made.rows] == [
        ["correct_bone", "2", 18],
        ["fit_rig", "1", 5],
        ["all", "3", 23],
    ]


def test_no_benchmarks(tmp_path: Path):
    assert build_metrics(read_jobs(tmp_path)) == {"jobs": (0, "1")}
    assert cost_table([]) is None


def test_warnings_of_jobs_are_read_from_their_logs(tmp_path: Path) -> None:
    """Logs are written by what every job's script calls."""
    scripts = Path(__file__).parents[2] / "workflow" / "scripts"
    code = (
        "import logging, sys; from common import log_to; log_to(sys.argv[1]);"
        "logging.getLogger('handpipe.rig').info('11:00:00 WARNING nothing: at all');"
        "[logging.getLogger('handpipe.rig').warning('%s: is 5 %% off', name) for name in sys.argv[2:]]"
    )
    for file, names in (
        ("fit_rig/all.log", ["MP2", "DIP2"]),
        ("simulate/close/1.log", ["fat"]),
        ("quiet/all.log", []),
    ):
        (tmp_path / file).parent.mkdir(parents=True)
        call = [sys.executable, "-c", code, str(tmp_path / file), *names]
        subprocess.run(
            call, check=True, env={**os.environ, "PYTHONPATH": os.pathsep.join([str(scripts), *sys.path])}
        )
    assert read_warnings(tmp_path) == {
        "fit_rig": ["MP2: is 5 % off", "DIP2: is 5 % off"],
        "simulate": ["close/1: fat: is 5 % off"],
    }
    assert read_warnings(tmp_path / "nowhere") == {}
