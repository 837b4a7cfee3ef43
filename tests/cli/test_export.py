"""What `handpipe export` writes, read by other libraries."""

import json
from pathlib import Path

import pandas as pd
import pytest

from handpipe.cli import export as exports
from handpipe.core import metrics, paths
from handpipe.core.configuration import Dataset, load_dataset

DATASET = Path(__file__).parents[2] / "config/datasets/phantom-finger.yaml"
ROWS = [
    {"pose": "fist", "error": 0.1, "doubt": 'says "no", twice\nand é'},
    {"pose": "flat", "error": 2.5e-17, "nearest": "spread"},
]


@pytest.fixture
def dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Dataset:
    monkeypatch.chdir(tmp_path)
    return load_dataset(DATASET)


def test_tables_and_metrics_are_csv(dataset: Dataset, tmp_path: Path):
    for stage, rows in (("skin", ROWS), ("limits", [])):
        file = paths.at(paths.table_of(stage), subject="finger")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(rows), encoding="utf-8")
    figures = {"skin": {"error_max": (0.25, "mm"), "seconds": (3.0, "s")}, "rig": {"seconds": (1 / 3, "s")}}
    for stage, values in figures.items():
        metrics.write(paths.at(paths.metrics_of(stage), subject="finger"), values)
    written = exports.export("finger", dataset, tmp_path / "out")
    assert [p.name for p in written] == ["finger-limits.csv", "finger-skin.csv", "finger-metrics.csv"]
    table = pd.read_csv(tmp_path / "out/finger-skin.csv", float_precision="round_trip")
    assert list(table) == ["pose", "error", "doubt", "nearest"]
    assert list(table["error"]) == [0.1, 2.5e-17]
    assert table["doubt"][0] == ROWS[0]["doubt"] and table["doubt"].isna()[1]
    found = pd.read_csv(tmp_path / "out/finger-metrics.csv", float_precision="round_trip")
    assert set(zip(found["stage"], found["name"], found["value"], found["unit"], strict=True)) == {
        ("skin", "error_max", 0.25, "mm"), ("skin", "seconds", 3.0, "s"), ("rig", "seconds", 1 / 3, "s"),
    }  # fmt: skip
