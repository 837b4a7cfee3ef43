"""Figures of the five sequences, from a folder whose tables and logs are known."""

import json

import pytest
from benchmarks.motions.__main__ import main
from benchmarks.motions.sequences import of_scene

from handpipe.core import metrics
from handpipe.core.errors import InputError


@pytest.fixture
def built(tmp_path):
    """Four frames of a fist in two chunks; the last one failed."""
    rows = [
        {
            "frame": "open",
            "fat_inverted_tets": 0.0,
            "fat_skin_crossings": 0.0,
            "muscles_body_penetration": 0.1,
        },
        {"frame": "half", "fat_inverted_tets": 2.0, "muscles_inverted_tets": 3.0, "fat_skin_crossings": 5.0},
        {"frame": "near", "fat_contact_unsettled": 1.0, "muscles_contact_unsettled": 1.0},
        {"frame": "fist", "failed": "fat", "reason": "no room"},
    ]
    for folder in ("tables", "metrics", "logs/simulate/close-fist"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "tables/frames-close-fist.json").write_text(json.dumps(rows))
    of_build = {"pops": (1.0, "frames"), "pop_max": (0.9, "mm/deg"), "frames_failed": (1.0, "frames")}
    metrics.write(tmp_path / "metrics/frames-close-fist.json", of_build)
    for chunk, lines in enumerate(
        (["open: muscles in 1.0 s", "open: fat in 3.0 s", "half: fat in 6.0 s"], ["near: fat in 8.0 s"])
    ):
        text = "".join(f"02:00:00 INFO frame {line}\n" for line in lines)
        (tmp_path / f"logs/simulate/close-fist/{chunk}.log").write_text(text)
    return tmp_path


def test_counts_are_sums_and_seconds_those_of_the_logs(built):
    found = {name: value for name, (value, _) in of_scene(built, "close-fist").items()}
    assert [found[n] for n in ("frames", "failed_frames", "unsettled_frames", "penetrations")] == [4, 1, 1, 5]
    assert found["inverted_tets"] == 3  # the worst layer of a frame
    assert found["body_penetration_max"] == 0.1 and found["pops"] == 1
    assert found["seconds_mean"] == pytest.approx(6) and found["seconds_max"] == 8
    assert found["hours"] == pytest.approx(18 / 3600)
    assert found["fat_share"] == pytest.approx(100 * 17 / 18)


def test_its_table_stands_beside_the_papers_and_absent_scenes_are_named(built, tmp_path, capsys):
    main([str(built), "--scenes", "close-fist", "--output", str(tmp_path / "out/frames.json")])
    found = metrics.read(tmp_path / "out/frames.json")
    assert found["sequence_frames"] == (4.0, "frames") and found["close-fist_failed_frames"] == (
        1.0,
        "frames",
    )
    assert (
        "| Close the fist | 4 | 1 | 6.0, 6.0, 8.0 | 0.01 | 14.1 |" in (tmp_path / "out/frames.md").read_text()
    )
    assert "sign-letters was not simulated" in capsys.readouterr().out
    with pytest.raises(InputError, match="numbers: has not been simulated"):
        of_scene(built, "numbers")
