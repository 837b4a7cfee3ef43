"""The page of results is of one build."""

import os
from pathlib import Path

import pytest

from handpipe.core import artifacts, metrics
from handpipe.core.errors import InputError
from handpipe.develop.results import main, page


def built(folder: Path, *commits: str) -> Path:
    """A subject's folder with one artifact a commit and one metric."""
    for i, commit in enumerate(commits):
        artifacts.write(folder / f"{i}.h5", {"x": 1.0}, kind="toy", attributes={"commit": commit})
    metrics.write(folder / "metrics" / "skin.json", {"example_error_mean": (0.12345, "mm")})
    return folder


def test_page_names_commit_and_figures(tmp_path: Path) -> None:
    output = tmp_path / "results.md"
    assert main([str(built(tmp_path / "hand", "a" * 40, "a" * 40)), "--output", str(output)]) == 0
    text = output.read_text()
    assert "a" * 40 in text
    assert "## hand" in text
    assert "| `skin`: `example_error_mean` | 0.123 mm | 0.17 mm (Zheng 2022 Table 4) |" in text


def test_models_of_the_skin_have_a_table_where_they_were_compared(tmp_path: Path) -> None:
    folder = built(tmp_path / "hand", "a")
    assert "Simpler models, hand" not in page([folder])
    figures = {"m3_heldout_error_mean": (0.06, "mm"), "m3_heldout_error_max": (1.2, "mm")}
    metrics.write(folder / "metrics" / "baselines.json", figures)
    text = page([folder])
    assert "### Simpler models, hand" in text
    assert "| m3: one soft tissue with plastic strains (Ichim 2017) |  | 0.06 mm; 1.2 mm |  |  |" in text


def test_variants_have_a_table_where_they_were_compared(tmp_path: Path) -> None:
    folder = built(tmp_path / "hand", "a")
    assert "Variants of the full model" not in page([folder])
    figures = {
        "m0_true_heldout_error_mean": (0.05, "mm"),
        "m0_MP2_knuckle_error_mean": (0.03, "mm"),
        "m0_passive_MP2_knuckle_error_mean": (0.3, "mm"),
        "no_tendons_true_heldout_error_mean": (0.06, "mm"),
        "no_tendons_true_heldout_error_max": (1.2, "mm"),
        "no_tendons_passive_true_heldout_error_mean": (0.4, "mm"),
        "no_tendons_MP2_knuckle_error_mean": (0.07, "mm"),
    }
    metrics.write(folder / "metrics" / "ablations.json", figures)
    text = page([folder])
    assert "### Variants of the full model, hand" in text
    row = "|  |  |  | 0.06 mm; 1.2 mm | 0.4 mm |  |  | 0.07 mm |"
    assert f"| `no_tendons`: no tendons under the fat {row}" in text
    assert text.count("over MP2") == 1


@pytest.mark.parametrize("commits", [("a", "b"), ("a-dirty",), ("",)])
def test_mixed_changed_and_unknown_builds_are_refused(tmp_path: Path, commits: tuple[str, ...]) -> None:
    output = tmp_path / "results.md"
    assert main([str(built(tmp_path / "hand", *commits)), "--output", str(output)]) == 1
    assert not output.exists()


def test_subjects_of_two_builds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="differs between artifacts"):
        page([built(tmp_path / "hand", "a"), built(tmp_path / "finger", "b")])


def test_metrics_of_an_earlier_build_are_refused(tmp_path: Path) -> None:
    folder = built(tmp_path / "hand", "a")
    os.utime(folder / "metrics" / "skin.json", (0, 0))
    with pytest.raises(InputError, match="older than every artifact"):
        page([folder])
