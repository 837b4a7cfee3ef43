"""The toy subject, built whole in a folder of its own, against truth."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import meshio
import pytest
import trimesh
import yaml

from .running import CHECKOUT, planned, run, watching, working_copy

# Bars on the figures that the stages measure against truth: the largest value that passes.
AT_MOST = [
    ("registration", "rotation_error_mean", 0.3, "deg"),
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


WATCHED = "watched"  # what each job read
Figure = Callable[[str, str, str], float]


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A working copy with everything, as `make finger` builds it but with coarser meshes.

    Nothing that was built before counts.
    """
    folder = working_copy(tmp_path_factory.mktemp("finger") / "copy")
    given = folder / "config" / "finger.yaml"
    settings = yaml.safe_load(given.read_text(encoding="utf-8")) | {"fidelity": "preview"}
    given.write_text(yaml.safe_dump(settings), encoding="utf-8")
    (folder / WATCHED).mkdir()
    process = run(folder, "-j2", "all", environment=watching(folder / WATCHED))
    assert process.returncode == 0, process.stdout[-5000:]
    return folder


@pytest.fixture(scope="session")
def results(folder: Path) -> Path:
    return folder / "results" / "phantom-finger"


@pytest.fixture(scope="session")
def figure(results: Path) -> Figure:
    """A stage's figure, whose unit must be the one that the bar is in."""

    def found(stage: str, name: str, unit: str) -> float:
        entry = json.loads((results / "metrics" / f"{stage}.json").read_text(encoding="utf-8"))[name]
        assert entry["unit"] == unit
        return entry["value"]

    return found


@pytest.mark.parametrize(("stage", "name", "bar", "unit"), AT_MOST)
def test_error_is_within_its_bar(figure: Figure, stage: str, name: str, bar: float, unit: str) -> None:
    assert 0 <= figure(stage, name, unit) <= bar


@pytest.mark.parametrize(("stage", "name", "bar", "unit"), AT_LEAST)
def test_overlap_reaches_its_bar(figure: Figure, stage: str, name: str, bar: float, unit: str) -> None:
    assert bar <= figure(stage, name, unit) <= 1


@pytest.mark.parametrize(("measure", "unit"), [("bone", "mm"), ("translation", "mm")])
def test_full_rig_beats_the_partial_one_in_unseen_poses(figure: Figure, measure: str, unit: str) -> None:
    full = figure("rig", f"heldout_{measure}_error_mean", unit)
    assert 0 < full < figure("rig", f"heldout_partial_{measure}_error_mean", unit)


@pytest.mark.parametrize("role", ["example", "heldout", "true_example", "true_heldout"])
def test_the_skin_is_measured(figure: Figure, role: str) -> None:
    median, worst = (figure("skin", f"{role}_error_{kind}", "mm") for kind in ("median", "max"))
    assert 0 < median < worst


@pytest.mark.slow
def test_the_full_model_is_compared_with_simpler_ones(folder: Path, figure: Figure) -> None:
    """`snakemake baselines`: blends of bones know nothing of scanned poses, m3 knows the examples' scans."""
    watched = folder / "watched-baselines"
    watched.mkdir()
    process = run(folder, "-j2", "baselines", environment=watching(watched))
    assert process.returncode == 0, process.stdout[-5000:]
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in watched.glob("*.json")]
    assert {job["rule"] for job in jobs} >= {
        "simulate_passive_skin",
        "simulate_baselines",
        "evaluate_baselines",
    }
    assert [job for job in jobs if job["undeclared"]] == []

    def mean(model: str, role: str) -> float:
        return figure("baselines", f"{model}_true_{role}_error_mean", "mm")

    for role in ("example", "heldout"):
        assert mean("m0", role) == figure("skin", f"true_{role}_error_mean", "mm")
        assert 0 < max(mean("m0", role), mean("m3", role)) < mean("m1", role) / 4
        assert mean("m1", role) < mean("m2", role)
        assert mean("m2", role) < mean("dual_quaternion", role) < mean("pivot", role)
    assert mean("m0", "example") < mean("m3", "example")
    best = 100 * mean("m0", "heldout") / mean("m3", "heldout")
    assert figure("baselines", "m0_over_best_true_heldout", "%") == pytest.approx(best)


def test_time_and_memory_of_the_build(figure: Figure) -> None:
    assert figure("build", "wall_seconds", "s") > 0
    assert figure("build", "peak_memory", "GiB") > 0.05  # no Python with numpy is smaller


def test_jobs_read_no_file_that_their_rules_do_not_declare(folder: Path) -> None:
    """Below the working copy, through Python or HDF5. Other rules: test_declared_files."""
    jobs = [json.loads(path.read_text(encoding="utf-8")) for path in (folder / WATCHED).glob("*.json")]
    assert [job for job in jobs if job["undeclared"]] == []
    assert {job["rule"] for job in jobs} == planned(folder, "all", "--forceall").keys() - {"all"}


def test_finished_build_does_nothing(folder: Path) -> None:
    process = run(folder, "-n", "all")
    assert process.returncode == 0
    assert "Nothing to be done" in process.stdout


def test_report_is_one_file(results: Path) -> None:
    """All that it shows is inside it: no link, image, script or style from elsewhere."""
    text = (results / "report.html").read_text(encoding="utf-8")
    loaded = re.findall(r"""<(?:img|script|iframe|source|video)\b[^>]*\bsrc\s*=\s*["']?([^"'\s>]+)""", text)
    loaded += re.findall(r"""<link\b[^>]*\bhref\s*=\s*["']?([^"'\s>]+)""", text)
    loaded += re.findall(r"""url\(\s*["']?([^"')\s]+)""", text)
    assert [address[:80] for address in loaded if not address.startswith(("data:", "#"))] == []
    assert text.count("data:image/png;base64,") > 0


def test_every_job_left_log_and_benchmark(results: Path, tmp_path: Path) -> None:
    expected = planned(working_copy(tmp_path / "copy"), "all")
    expected.pop("all")
    left = {
        kind: {
            rule: {
                p.relative_to(results / kind).with_suffix("") for p in (results / kind / rule).rglob(ending)
            }
            for rule in expected
        }
        for kind, ending in (("logs", "*.log"), ("benchmarks", "*.tsv"))
    }
    assert left["logs"] == left["benchmarks"]
    wanting = {rule: count for rule, count in expected.items() if len(left["logs"][rule]) < count}
    assert wanting == {}


def test_no_temporary_file_is_left(results: Path) -> None:
    assert [p for p in results.rglob(".*") if p.is_file() and p.name != ".snakemake_timestamp"] == []


@pytest.mark.parametrize(
    "scene", yaml.safe_load((CHECKOUT / "config/finger.yaml").read_text(encoding="utf-8"))["scenes"]
)
def test_exported_scene_opens_elsewhere(results: Path, scene: str) -> None:
    folder = results / "simulation" / scene
    loaded = trimesh.load(folder / f"{scene}.glb")
    assert isinstance(loaded, trimesh.Scene)
    assert len(loaded.geometry) > 1
    files = sorted((folder / "vtk").rglob("*.vtu"))
    assert files
    for path in files:
        mesh = meshio.read(path)
        assert len(mesh.points) > 0
        assert sum(len(block.data) for block in mesh.cells) > 0
