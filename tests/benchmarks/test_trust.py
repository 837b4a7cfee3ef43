"""The figures of trust, part by part and together."""

from pathlib import Path

import pytest
from benchmarks.trust.__main__ import main

from handpipe.core import metrics


def test_parts_are_merged(tmp_path: Path) -> None:
    metrics.write(tmp_path / "a.json", {"kills": (20, "1")})
    metrics.write(tmp_path / "b.json", {"frames": (60, "1")})
    main(["merge", str(tmp_path / "a.json"), str(tmp_path / "b.json"), "--output", str(tmp_path / "c.json")])
    assert metrics.read(tmp_path / "c.json") == {"kills": (20, "1"), "frames": (60, "1")}


def test_a_figure_has_one_part(tmp_path: Path) -> None:
    for name in "ab":
        metrics.write(tmp_path / f"{name}.json", {"kills": (20, "1")})
    files = [str(tmp_path / f"{name}.json") for name in "ab"]
    with pytest.raises(ValueError, match=r"b\.json: kills"):
        main(["merge", *files, "--output", str(tmp_path / "c.json")])
