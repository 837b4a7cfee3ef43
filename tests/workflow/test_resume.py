"""A build that was killed goes on with the same command, to the same results; a finished one does nothing."""

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from .running import ENVIRONMENT, command, job_counts, run

BUILD = ("-j2", "segmentation", "--config", "subjects=[small]")


@contextmanager
def build_in_the_middle(folder: Path) -> Iterator[int]:
    """A build in a process group of its own, with some bones segmented; the group is killed at the end.

    Gives the number of the group.
    """
    process = subprocess.Popen(
        command(BUILD),
        cwd=folder,
        env=ENVIRONMENT,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        deadline = time.monotonic() + 120
        while not list(folder.glob("results/small/segmentation/*/bones.h5")):
            assert process.poll() is None, "the build ended before it could be killed"
            assert time.monotonic() < deadline, "the build made nothing"
            time.sleep(0.02)
        yield process.pid
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def contents(folder: Path) -> dict[str, dict[str, np.ndarray] | bytes]:
    """Every result by path, temporary ones too: arrays of HDF5 files, bytes of others; no figures of time."""
    found: dict[str, dict[str, np.ndarray] | bytes] = {}
    base = folder / "results" / "small"
    for path in sorted(base.rglob("*")):
        name = path.relative_to(base)
        if path.is_dir() or name.parts[0] in ("logs", "benchmarks", "metrics"):
            continue
        half_written = path.name.startswith(".")
        is_artifact = path.suffix == ".h5" and not half_written
        found[name.as_posix()] = arrays(path) if is_artifact else path.read_bytes()
    return found


def arrays(path: Path) -> dict[str, np.ndarray]:
    """Every dataset of an HDF5 file by its name, and the file's attributes."""
    with h5py.File(path) as file:
        values = {f"attribute {key}": np.asarray(value) for key, value in file.attrs.items()}
        file.visititems(
            lambda name, item: values.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None
        )
    return values


def test_killed_build_goes_on_to_the_same_results(small: Path, built_small: Path) -> None:
    with build_in_the_middle(small):
        pass  # leaving kills it
    assert not (small / "results/small/metrics/segmentation.json").exists()
    process = run(small, *BUILD)
    assert process.returncode == 0, process.stdout
    assert "merge_labels" in job_counts(process.stdout)
    found, expected = contents(small), contents(built_small)
    assert found.keys() == expected.keys()  # so the temporary files of the killed jobs are gone
    for name, value in expected.items():
        np.testing.assert_equal(found[name], value, err_msg=name)


def test_finished_build_does_nothing(built_small: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    process = run(folder, *BUILD)
    assert process.returncode == 0
    assert "Nothing to be done" in process.stdout


def test_second_build_in_one_folder_is_refused(small: Path) -> None:
    """The lock holds for as long as a build runs; the tests above show that it is free after a kill."""
    with build_in_the_middle(small) as group:
        os.killpg(group, signal.SIGSTOP)  # however long the second build takes to begin, the first one runs
        process = run(small, *BUILD)
    assert process.returncode != 0
    assert "handpipe: another build runs in this folder" in process.stdout
