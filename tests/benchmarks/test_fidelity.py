"""The benchmark of fidelities: what it copies, what it reads of a build, what it shows."""

import re
from pathlib import Path

import pytest
from benchmarks.fidelity.chain import POINTS, SCENE, figures, prepared
from benchmarks.fidelity.document import main, table

from handpipe.core import metrics

CHECKOUT = Path(__file__).parents[2]


def finger(folder: Path) -> Path:
    """A built finger, as far as the benchmark copies it."""
    for name in (
        "data/volumes/fist.nii.gz",
        "segmentation/fist/surfaces.h5",
        "registration/fist.h5",
        "rig.h5",
    ):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name, encoding="utf-8")
    return folder


def test_a_point_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    built = finger(tmp_path / "finger")
    folder = prepared(tmp_path / "point", built)
    skin = folder / "results/phantom-finger/skin.h5"
    skin.write_text("made", encoding="utf-8")
    (folder / "config/config.yaml").write_text("changed", encoding="utf-8")
    again = prepared(folder, built)
    assert skin.read_text(encoding="utf-8") == "made"
    kept, source = (at / "rig.h5" for at in (skin.parent, built))
    assert kept.stat().st_mtime == source.stat().st_mtime  # or Snakemake would make it anew
    text = (CHECKOUT / "config/config.yaml").read_text(encoding="utf-8")
    assert (again / "config/config.yaml").read_text(encoding="utf-8") == text


def test_figures_of_a_build_whose_tendons_failed(tmp_path: Path) -> None:
    metrics.write(
        tmp_path / "metrics/skin.json", {"true_heldout_error_mean": (0.5, "mm"), "seconds": (9, "s")}
    )
    log = tmp_path / "logs/simulate" / SCENE / "0.log"
    log.parent.mkdir(parents=True)
    log.write_text(
        "frame a: fat in 3.0 s\nframe a: bones in 1.0 s\nframe b: fat in 2.0 s\n", encoding="utf-8"
    )
    assert figures(tmp_path) == {
        "skin_true_heldout_error_mean": (0.5, "mm"),
        "skin_fit_seconds": (9, "s"),
        "frame_seconds_mean": (3.0, "s"),
        "frame_seconds_max": (4.0, "s"),
    }


def test_picture_and_table_of_the_points_that_were_measured(tmp_path: Path) -> None:
    found: metrics.Metrics = {}
    for point, seconds, error in (("preview", 2.0, 0.9), ("standard", 5.0, 0.6)):
        found[f"{point}_frame_seconds_mean"] = (seconds, "s")
        found[f"{point}_skin_true_heldout_error_mean"] = (error, "mm")
    assert table(found).splitlines()[2:] == [
        "| preview | 2 |  | 0.9 |  |  |",
        "| standard | 5 |  | 0.6 |  |  |",
    ]
    metrics.write(tmp_path / "all.json", found)
    main([str(tmp_path / "all.json"), "--output", str(tmp_path / "all.png")])
    assert (tmp_path / "all.png").stat().st_size > 5000
    assert (tmp_path / "all.md").exists()


@pytest.mark.parametrize("name", POINTS)
def test_rules_know_the_points(name: str) -> None:
    rules = (CHECKOUT / "workflow/rules/benchmarks.smk").read_text(encoding="utf-8")
    [listed] = re.findall(r"FIDELITIES = \[(.*)\]", rules)
    assert f'"{name}"' in listed
