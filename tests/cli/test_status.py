"""How long jobs take: by a subject's own, else by other subjects', else by the generated hand's."""

from __future__ import annotations

from pathlib import Path

import pytest
from benchmarks.cluster.measured import Measured
from benchmarks.cluster.typical import typical

from handpipe.cli.status import TYPICAL, stages

WHOLE = {"segment_pose": 4, "fit_rig": 1, "no_such_rule": 2}


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def add_job(folder: Path, subject: str, seconds: float) -> None:
    path = folder / f"results/{subject}/benchmarks/segment_pose/bent.tsv"
    path.parent.mkdir(parents=True)
    path.write_text(f"s\tcpu_time\tmax_rss\n{seconds}\t1\t1\n", encoding="utf-8")


def test_without_a_build_lengths_are_those_of_the_generated_hand(empty: Path) -> None:
    lengths = Measured.read().rules()["segment_pose"]
    segment, rig, other = stages({"segment_pose": 3, "no_such_rule": 2}, WHOLE, "mine")
    assert (segment.done, segment.left) == (1, 3) and segment.typical
    assert segment.seconds == pytest.approx(sum(lengths) / len(lengths), abs=0.05)
    assert segment.seconds_left == 3 * segment.seconds
    assert (rig.done, rig.left, rig.seconds_left) == (1, 0, 0)
    assert other.seconds is None and not other.typical


def test_own_jobs_come_before_those_of_other_subjects(empty: Path) -> None:
    add_job(empty, "other", 7.0)
    segment, rig, _ = stages({}, WHOLE, "mine")
    assert segment.seconds == 7.0 and not segment.typical and rig.typical
    add_job(empty, "mine", 3.0)
    assert stages({}, WHOLE, "mine")[0].seconds == 3.0


def test_the_shipped_lengths_are_those_of_the_measured_build() -> None:
    assert TYPICAL.read_text(encoding="utf-8") == typical(Measured.read())
