"""Rules of levels on the small subject: learned from a scene of random poses, then scenes at levels."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from handpipe.cli import main
from handpipe.hand.frames import read_frames

from .running import ENVIRONMENT, TOY, planned, run, watching

RANDOM = "random: {count: 10, seed: 1, around: scans}\n"
LEARNED = "layers: [skin]\nframes: config/scenes/targets/draw.yaml\nchunk: 10\n"
LEVEL = "layers: [skin]\nframes: config/scenes/shown.csv\nlevel: L1\nlearned: drawn\n"
SPRINGS = "layers: [bones, skin]\nframes: config/scenes/shown.csv\nlevel: L2\n"
CREASES = "layers: [bones, skin]\nframes: config/scenes/shown.csv\nlevel: L3\n"
GIVEN = ("--config", "subjects=[small]", "scenes=[shown]")


@pytest.fixture(scope="module")
def folder(built_small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working copy with both scenes."""
    copied = Path(shutil.copytree(built_small, tmp_path_factory.mktemp("levels") / "copy"))
    scenes = copied / "config" / "scenes"
    (scenes / "targets").mkdir(exist_ok=True)
    (scenes / "targets/draw.yaml").write_text(RANDOM)
    (scenes / "drawn.yaml").write_text(LEARNED)
    (scenes / "shown.csv").write_text("frame,hinge_flexion [deg]\nrest,0\nbent,8\n")
    (scenes / "shown.yaml").write_text(LEVEL)
    (scenes / "sprung.yaml").write_text(SPRINGS)
    (scenes / "creased.yaml").write_text(CREASES)
    (copied / "watched").mkdir()
    return copied


@pytest.mark.slow
def test_frames_are_learned_and_their_table_has_bounds_and_distances(folder: Path) -> None:
    target = "results/small/tables/frames-shown.json"
    plan = planned(folder, target, *GIVEN)
    assert plan["learn_levels"] == plan["animate"] == plan["simulate"] == 1
    process = run(folder, "-j2", target, *GIVEN, environment=watching(folder / "watched"))
    assert process.returncode == 0, process.stdout[-5000:]
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in (folder / "watched").glob("*.json")]
    assert {"learn_levels", "animate"} <= {job["rule"] for job in jobs}
    assert [job for job in jobs if job["undeclared"]] == []
    rows = json.loads((folder / target).read_text(encoding="utf-8"))
    assert [row["frame"] for row in rows] == ["rest", "bent"]
    assert all(row["skin_level_bound"] > 0 and row["skin_level_distance"] >= 0 for row in rows)
    frames = read_frames(folder / "results/small/simulation/shown/frames-0.h5")
    assert [frame.name for frame, _ in frames] == ["rest", "bent"]


@pytest.mark.slow
def test_the_page_of_a_learned_hand_is_built_by_the_command(folder: Path) -> None:
    page = "results/small/simulation/drawn/player.html"
    watched = folder / "watched-player"
    watched.mkdir()
    arguments = ("play", "small", "--scene", "shown", "--no-browser")
    process = subprocess.run(
        [sys.executable, "-m", "handpipe.cli", *arguments, TOY, "--cores", "2"],
        cwd=folder,
        env=ENVIRONMENT | watching(watched),
        encoding="utf-8",
        capture_output=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr[-5000:]
    assert process.stdout.splitlines()[-1] == page
    text = (folder / page).read_text(encoding="utf-8")
    assert "small" in text.partition("</title>")[0] and "<h2>MRI slice</h2>" in text
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in watched.glob("*.json")]
    assert "export_player" in {job["rule"] for job in jobs}
    assert [job for job in jobs if job["undeclared"]] == []


def test_a_page_of_no_scene_is_refused(folder: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(folder)
    assert main(["play", "small", "--scene", "none"]) == 1
    assert "config/scenes/none.yaml: file: does not exist" in capsys.readouterr().err


def test_a_scene_without_the_layers_is_refused_before_anything_is_built(folder: Path) -> None:
    file = folder / "config/scenes/shown.yaml"
    file.write_text(LEVEL.replace("layers: [skin]", "layers: [bone_fascia]"))
    process = run(folder, "-n", "simulation", *GIVEN)
    file.write_text(LEVEL)
    assert process.returncode != 0
    assert "learned: drawn has no bone_fascia" in process.stdout


@pytest.mark.parametrize(
    "text", ["{layers: [bones, skin], frames: config/scenes/shown.csv, level: L2}", '"level": L2\n']
)
def test_a_level_is_told_however_the_file_is_written(folder: Path, text: str) -> None:
    """Else the scene would be simulated without a word."""
    if not text.startswith("{"):
        text += "layers: [bones, skin]\nframes: config/scenes/shown.csv\n"
    (folder / "config/scenes/written.yaml").write_text(text)
    target = "results/small/simulation/written/frames-0.h5"
    plan = planned(folder, target, "--config", "subjects=[small]", "scenes=[written]")
    assert plan["animate_springs"] == 1 and "simulate" not in plan


def test_a_scene_of_springs_needs_the_rig_and_the_skin_alone(folder: Path) -> None:
    given = ("--config", "subjects=[small]", "scenes=[sprung]")
    target = "results/small/tables/frames-sprung.json"
    plan = planned(folder, target, *given)
    assert plan["animate_springs"] == 1
    assert not {"simulate", "animate", "learn_levels"} & set(plan)
    watched = folder / "watched_springs"
    watched.mkdir()
    process = run(folder, "-j2", target, *given, environment=watching(watched))
    assert process.returncode == 0, process.stdout[-5000:]
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in watched.glob("*.json")]
    assert "animate_springs" in {job["rule"] for job in jobs}
    assert [job for job in jobs if job["undeclared"]] == []
    rows = json.loads((folder / target).read_text(encoding="utf-8"))
    assert [row["frame"] for row in rows] == ["rest", "bent"]
    assert all(0 <= row["skin_spring_residual"] <= 0.1 for row in rows)


@pytest.mark.slow
def test_a_scene_with_creases_is_simulated_on_a_tissue_of_its_own(folder: Path) -> None:
    given = ("--config", "subjects=[small]", "scenes=[creased]")
    target = "results/small/tables/frames-creased.json"
    plan = planned(folder, target, *given)
    assert plan["mesh_crease_tissue"] == plan["simulate"] == 1
    assert not {"animate", "animate_springs", "learn_levels", "mesh_soft_tissue"} & set(plan)
    watched = folder / "watched_creases"
    watched.mkdir()
    process = run(folder, "-j2", target, *given, environment=watching(watched))
    assert process.returncode == 0, process.stdout[-5000:]
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in watched.glob("*.json")]
    assert {"mesh_crease_tissue", "simulate"} <= {job["rule"] for job in jobs}
    assert [job for job in jobs if job["undeclared"]] == []
    rows = json.loads((folder / target).read_text(encoding="utf-8"))
    assert [row["frame"] for row in rows] == ["rest", "bent"]
    assert all(row["skin_skin_crossings"] == 0 for row in rows)
