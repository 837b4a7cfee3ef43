"""A training set of the small subject by the command: killed, gone on with, and in other shards."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from .running import ENVIRONMENT, TOY, planned, run, watching

RANDOM = "random: {count: 6, seed: 1, around: scans, seeds: each}\n"
SCENE = "layers: [bones, skin]\nframes: config/scenes/targets/many.yaml\nlevel: L2\nchunk: %d\n"
SHARDS = "results/small/simulation/many/shards"
COMMAND = (sys.executable, "-m", "handpipe.cli", "shards", "small", "--scene", "many", TOY, "--cores", "2")


def copy_with(built: Path, folder: Path, chunk: int) -> Path:
    copied = Path(shutil.copytree(built, folder))
    scenes = copied / "config" / "scenes"
    (scenes / "targets").mkdir(exist_ok=True)
    (scenes / "targets/many.yaml").write_text(RANDOM)
    (scenes / "many.yaml").write_text(SCENE % chunk)
    (copied / "watched").mkdir()
    return copied


def command(folder: Path) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        COMMAND,
        cwd=folder,
        env=ENVIRONMENT | watching(folder / "watched"),
        encoding="utf-8",
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def build(folder: Path) -> None:
    process = command(folder)
    out, err = process.communicate()
    assert process.returncode == 0, err[-5000:]
    assert out.splitlines()[-1] == f"{SHARDS}/index.json"


def kill_after_a_shard(folder: Path) -> list[Path]:
    """The shards of a build that is killed when it has made one."""
    process = command(folder)
    try:
        deadline = time.monotonic() + 120
        while not list((folder / SHARDS).glob("shard-*.npz")):
            assert process.poll() is None, process.communicate()[1][-5000:]
            assert time.monotonic() < deadline, "no shard was made"
            time.sleep(0.02)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    return sorted((folder / SHARDS).glob("shard-*.npz"))


def frames(folder: Path) -> dict[int, dict[str, np.ndarray]]:
    """Arrays of each frame by its number."""
    found = {}
    for path in (folder / SHARDS).glob("shard-*.npz"):
        with np.load(path) as arrays:
            names = [name for name in arrays.files if not name.startswith("invalid/")]
            for row, number in enumerate(arrays["number"]):
                found[int(number)] = {name: arrays[name][row] for name in names}
    return found


@pytest.fixture(scope="module")
def folder(built_small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built after it was killed."""
    copied = copy_with(built_small, tmp_path_factory.mktemp("shards") / "copy", 2)
    shards = kill_after_a_shard(copied)
    before = {path: path.read_bytes() for path in shards}
    computed = [path.parents[1] / f"frames-{path.stem[-1]}.h5" for path in shards]
    kept = {path: path.stat().st_mtime_ns for path in computed}
    assert not (copied / SHARDS / "index.json").exists()
    build(copied)
    assert before == {path: path.read_bytes() for path in before}
    assert kept == {path: path.stat().st_mtime_ns for path in kept}  # what was finished is not made again
    return copied


@pytest.mark.slow
def test_a_killed_build_and_one_of_other_shards_give_the_same_frames(
    folder: Path, built_small: Path, tmp_path: Path
) -> None:
    whole = copy_with(built_small, tmp_path / "copy", 4)
    build(whole)
    assert len(list((whole / SHARDS).glob("shard-*.npz"))) == 2
    assert len(list((folder / SHARDS).glob("shard-*.npz"))) == 3
    found, expected = frames(folder), frames(whole)
    assert found.keys() == expected.keys() == set(range(6))
    for number, arrays in expected.items():
        for name, values in arrays.items():
            assert values.tobytes() == found[number][name].tobytes(), (number, name)
    index = json.loads((folder / SHARDS / "index.json").read_text(encoding="utf-8"))
    assert index["frames"] + len(index["invalid"]) == 6
    assert index["level"] == "L2" and "skin/skin" in index["bodies"]["vertices"]


@pytest.mark.slow
def test_its_jobs_open_declared_files_only(folder: Path) -> None:
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in (folder / "watched").glob("*.json")]
    assert {"make_shard", "index_shards"} <= {job["rule"] for job in jobs}
    assert [job for job in jobs if job["undeclared"]] == []


@pytest.mark.slow
def test_a_finished_one_does_nothing(folder: Path) -> None:
    given = ("--config", "subjects=[small]", "scenes=[many]")
    assert planned(folder, f"{SHARDS}/index.json", *given) == {}


def test_a_scene_of_other_frames_is_refused(built_small: Path, tmp_path: Path) -> None:
    folder = copy_with(built_small, tmp_path / "copy", 2)
    (folder / "config/scenes/bent.csv").write_text("frame,hinge_flexion [deg]\nrest,0\nbent,8\n")
    (folder / "config/scenes/bent.yaml").write_text(
        "layers: [bones, skin]\nframes: config/scenes/bent.csv\nlevel: L2\n"
    )
    target = "results/small/simulation/bent/shards/index.json"
    process = run(folder, "-n", target, "--config", "subjects=[small]", "scenes=[bent]")
    assert process.returncode != 0
    assert "asks for no random poses" in process.stdout
