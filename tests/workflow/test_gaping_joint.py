"""A joint whose bones do not meet: seeds are proposed all the same, and the log names the gap."""

from pathlib import Path

import pytest

from . import small_subject
from .running import run, working_copy

SEEDS = "results/small/segmentation/bent/seeds.nii.gz"


def test_a_joint_that_gapes_is_named_and_stops_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(small_subject, "SHAPE", (48, 30, 30))
    monkeypatch.setitem(small_subject.MIDDLE, "far", (36.0, 14.5, 14.5))
    folder = working_copy(tmp_path / "copy")
    dataset = small_subject.write_subject(folder)
    del dataset["poses"]["bent"]["seeds"], dataset["poses"]["bent"]["scribbles"]
    small_subject.write_dataset(folder, dataset)
    process = run(folder, "-j1", SEEDS, "--config", "subjects=[small]")
    assert process.returncode == 0, process.stdout
    logs = folder / "results/small/logs"
    assert "joint hinge gapes by" in (logs / "merge_labels/flat.log").read_text()
    said = (logs / "propose_seeds/bent.log").read_text()
    assert "joint hinge: its bones are" in said and "poses.flat.scribbles" in said
