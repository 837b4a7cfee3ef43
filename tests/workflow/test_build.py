"""The toy subject, built whole in the checkout (at once if it is built already), against truth."""

import json
import re
from pathlib import Path

import meshio
import pytest
import trimesh
import yaml

from .running import CHECKOUT, planned, run, working_copy

RESULTS = CHECKOUT / "results" / "phantom-finger"

# Bars on the figures that the stages measure against truth: the largest value that passes.
AT_MOST = [
    ("registration", "rotation_error_mean", 1.0, "deg"),
    ("registration", "translation_error_mean", 0.25, "mm"),
    ("rig", "rotation_error_mean", 1.0, "deg"),
    ("rig", "translation_error_mean", 0.25, "mm"),
    ("tendons", "centreline_error_mean", 0.4, "mm"),
    ("tendons", "length_change_max", 0.1, "%"),
    ("muscles", "surface_error_mean", 0.4, "mm"),
    ("muscles", "surface_error_max", 2.0, "mm"),
    ("muscles", "penetration_max", 0.1, "mm"),
    ("muscles", "inverted_tets", 0, "1"),
    ("skin", "example_error_mean", 0.3, "mm"),
    ("skin", "heldout_error_mean", 0.8, "mm"),
    ("skin", "true_example_error_mean", 0.1, "mm"),
    ("skin", "true_heldout_error_mean", 0.2, "mm"),
]
AT_LEAST = [("segmentation", "dice_mean", 0.95, "1"), ("segmentation", "dice_min", 0.90, "1")]


@pytest.fixture(scope="session", autouse=True)
def build() -> None:
    """Everything, as `make finger` builds it."""
    process = run(CHECKOUT, "-j2", "all")
    assert process.returncode == 0, process.stdout[-5000:]


def figure(stage: str, name: str, unit: str) -> float:
    """A stage's figure, whose unit must be the one that the bar is in."""
    entry = json.loads((RESULTS / "metrics" / f"{stage}.json").read_text(encoding="utf-8"))[name]
    assert entry["unit"] == unit
    return entry["value"]


@pytest.mark.parametrize(("stage", "name", "bar", "unit"), AT_MOST)
def test_error_is_within_its_bar(stage: str, name: str, bar: float, unit: str) -> None:
    assert 0 <= figure(stage, name, unit) <= bar


@pytest.mark.parametrize(("stage", "name", "bar", "unit"), AT_LEAST)
def test_overlap_reaches_its_bar(stage: str, name: str, bar: float, unit: str) -> None:
    assert bar <= figure(stage, name, unit) <= 1


@pytest.mark.parametrize(("measure", "unit"), [("rotation", "deg"), ("translation", "mm")])
def test_full_rig_beats_the_partial_one_in_unseen_poses(measure: str, unit: str) -> None:
    full = figure("rig", f"heldout_{measure}_error_mean", unit)
    assert 0 < full < figure("rig", f"heldout_partial_{measure}_error_mean", unit)


@pytest.mark.parametrize("model", ["", "m1_", "m2_"])
@pytest.mark.parametrize("role", ["example", "heldout", "true_example", "true_heldout"])
def test_skin_of_every_model_is_measured(model: str, role: str) -> None:
    median, worst = (figure("skin", f"{model}{role}_error_{kind}", "mm") for kind in ("median", "max"))
    assert 0 < median < worst


def test_time_and_memory_of_the_build() -> None:
    assert figure("build", "wall_seconds", "s") > 0
    assert figure("build", "peak_memory", "GiB") > 0.05  # no Python with numpy is smaller


def test_finished_build_does_nothing() -> None:
    process = run(CHECKOUT, "-n", "all")
    assert process.returncode == 0
    assert "Nothing to be done" in process.stdout


def test_report_is_one_file() -> None:
    """All that it shows is inside it: no link, image, script or style from elsewhere."""
    text = (RESULTS / "report.html").read_text(encoding="utf-8")
    loaded = re.findall(r"""<(?:img|script|iframe|source|video)\b[^>]*\bsrc\s*=\s*["']?([^"'\s>]+)""", text)
    loaded += re.findall(r"""<link\b[^>]*\bhref\s*=\s*["']?([^"'\s>]+)""", text)
    loaded += re.findall(r"""url\(\s*["']?([^"')\s]+)""", text)
    assert [address[:80] for address in loaded if not address.startswith(("data:", "#"))] == []
    assert text.count("data:image/png;base64,") > 0


def test_every_job_left_log_and_benchmark(tmp_path: Path) -> None:
    expected = planned(working_copy(tmp_path / "copy"), "all")
    expected.pop("all")
    left = {
        kind: {
            rule: {
                p.relative_to(RESULTS / kind).with_suffix("") for p in (RESULTS / kind / rule).rglob(ending)
            }
            for rule in expected
        }
        for kind, ending in (("logs", "*.log"), ("benchmarks", "*.tsv"))
    }
    assert left["logs"] == left["benchmarks"]
    wanting = {rule: count for rule, count in expected.items() if len(left["logs"][rule]) < count}
    assert wanting == {}


def test_no_temporary_file_is_left() -> None:
    assert [p for p in RESULTS.rglob(".*") if p.is_file() and p.name != ".snakemake_timestamp"] == []


@pytest.mark.parametrize(
    "scene", yaml.safe_load((CHECKOUT / "config/finger.yaml").read_text(encoding="utf-8"))["scenes"]
)
def test_exported_scene_opens_elsewhere(scene: str) -> None:
    folder = RESULTS / "simulation" / scene
    loaded = trimesh.load(folder / f"{scene}.glb")
    assert isinstance(loaded, trimesh.Scene)
    assert len(loaded.geometry) > 1
    files = sorted((folder / "vtk").rglob("*.vtu"))
    assert files
    for path in files:
        mesh = meshio.read(path)
        assert len(mesh.points) > 0
        assert sum(len(block.data) for block in mesh.cells) > 0
