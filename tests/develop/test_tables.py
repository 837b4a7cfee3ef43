"""The tables of a built subject count what its artifacts hold."""

import csv
from pathlib import Path

import numpy as np
import pytest

from handpipe.core import artifacts
from handpipe.core.errors import InputError
from handpipe.develop.tables import main, tables

COMMIT = {"commit": "a" * 40}


def mesh(vertices: int, cells: str, count: int) -> dict[str, np.ndarray]:
    return {"vertices": np.zeros((vertices, 3)), cells: np.zeros((count, 3), dtype=np.int64)}


@pytest.fixture
def hand(tmp_path: Path) -> Path:
    """Two bones, two tendons, a cloth, and two chunks of a scene; one frame was simulated twice."""
    folder = tmp_path / "hand"
    bones = {"one": mesh(10, "triangles", 16), "two": mesh(20, "triangles", 36)}
    made = {
        "rig.h5": {"surfaces": bones},
        "tendons/long/neutral.h5": {"x": np.zeros((7, 3))},
        "tendons/short/neutral.h5": {"x": np.zeros((4, 3))},
        "fascia/bone.h5": {
            "surface": mesh(5, "triangles", 6),
            "settings": {"young": 0.1, "poisson": 0.48, "shrink": 0.35},
        },
    }
    for name, content in made.items():
        artifacts.write(folder / name, content, kind="toy", attributes=COMMIT)
    logs = folder / "logs/simulate/fist"
    logs.mkdir(parents=True)
    said = "22:44:45 INFO handpipe.hand.simulation: frame {}: {} in {} s\n"
    again = said.format("a: b", "fat", "90.0") + said.format("a: b", "fat", "3.0")
    (logs / "0.log").write_text(again + said.format("a: b", "bones", "1.0"), encoding="utf-8")
    (logs / "1.log").write_text(said.format("second", "fat", "6.0"), encoding="utf-8")
    costs = folder / "benchmarks/fit_hooks"
    costs.mkdir(parents=True)
    for name, seconds in (("long", 3.0), ("short", 2.0)):
        (costs / f"{name}.tsv").write_text(f"s\tmax_rss\tcpu_time\n{seconds}\t512\t1.5\n", encoding="utf-8")
    return folder


def test_counts_parameters_frames_and_stages(hand: Path) -> None:
    meshes, parameters, scenes, stages = tables(hand)
    assert [row[:-1] for row in meshes.rows] == [
        ("bones", "skinning", 2, 10, 20, 15, 30, 52),
        ("tendons", "rod", 2, 4, 7, 6, 11, ""),
        ("bone fascia", "cloth", 1, 5, 5, 5, 5, 6),
    ]
    assert parameters.rows[2][:2] == ("bone fascia rest size", 0.35)
    assert dict(zip(scenes.columns, scenes.rows[0], strict=True)) == {
        "scene": "fist",
        "frames": 2,
        "s a frame, mean": 5.0,
        "s a frame, most": 6.0,
        "h in all": 10 / 3600,
        "fat, %": 90.0,
        "bones, %": 10.0,
    }
    assert stages.rows == [("tendons", "fit_hooks", 2, 5.0, 3.0, 3.0, 0.5)]


def test_page_and_csv(hand: Path, tmp_path: Path) -> None:
    output = tmp_path / "tables.md"
    assert main([str(hand), "--output", str(output), "--csv", str(tmp_path / "csv")]) == 0
    assert "| tendons | rod | 2 | 4 | 7 | 6 | 11 |  | 3,210 |" in output.read_text(encoding="utf-8")
    rows = list(csv.DictReader((tmp_path / "csv/hand-meshes.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["sum"] for row in rows] == ["30", "11", "5"]


def test_a_folder_without_a_build_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="rig.h5"):
        tables(tmp_path)
