"""A build makes what its target and its scenes need, and a change reruns what depends on it."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from .running import planned, run, working_copy
from .small_subject import LABELS, ball, seeds, write_image, write_mesh

SMALL = ("--config", "subjects=[small]")
DEEPER = ("muscle", "tendon", "ligament", "fascia", "fat", "hooks", "inner")


def deeper(rules: dict[str, int]) -> set[str]:
    return {rule for rule in rules if any(word in rule for word in DEEPER)}


@pytest.fixture(scope="module")
def nothing_built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return working_copy(tmp_path_factory.mktemp("needed") / "copy")


@pytest.mark.parametrize("target", ["simulation", "all"])
def test_bones_and_skin_need_no_inner_tissue(nothing_built: Path, target: str) -> None:
    rules = planned(nothing_built, target, "--config", "scenes=[bones-and-skin]")
    assert {"segment_bone", "fit_rig", "mesh_soft_tissue", "simulate", "export_scene"} <= set(rules)
    assert deeper(rules) == set()


def test_every_layer_needs_every_tissue(nothing_built: Path) -> None:
    rules = planned(nothing_built, "simulation")
    tissues = {"extract_muscle", "fit_hooks", "fit_ligament", "make_muscle_fascia", "mesh_fat"}
    assert tissues <= deeper(rules)


def test_rig_needs_no_tissue(nothing_built: Path) -> None:
    rules = planned(nothing_built, "rig")
    assert deeper(rules) == set()
    assert "simulate" not in rules


def changed(folder: Path, before: dict[str, int]) -> set[str]:
    return {path for path, time in artifact_times(folder).items() if before.get(path) != time}


def artifact_times(folder: Path) -> dict[str, int]:
    """When each file of the small subject's segmentation was written."""
    base = folder / "results" / "small" / "segmentation"
    return {p.relative_to(base).as_posix(): p.stat().st_mtime_ns for p in base.rglob("*") if p.is_file()}


def test_scribbles_rerun_their_bone_alone(built_small: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    before = artifact_times(folder)
    drawn = np.where(seeds() == LABELS["far"], LABELS["far"], 0).astype(np.uint8)
    write_image(folder / "small" / "bent-far.nii.gz", drawn)
    assert planned(folder, "segmentation", *SMALL) == {
        "segment_bone": 1,
        "merge_labels": 1,
        "evaluate_segmentation": 1,
        "segmentation": 1,
    }
    process = run(folder, "-j2", "segmentation", *SMALL)
    assert process.returncode == 0, process.stdout
    merged = {f"bent/{name}" for name in ("labels.nii.gz", "labels.json", "surfaces.h5")}
    assert changed(folder, before) == {"bent/bones/far.h5", *merged}


def test_changed_scan_is_checked_but_images_stay(built_small: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    write_mesh(folder / "small" / "bent.ply", ball().apply_scale(1.1))
    assert planned(folder, "segmentation", *SMALL) == {"check_subject": 1}
