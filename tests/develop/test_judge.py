"""Figures of test hands: means, spread and ratio by hand, refused where they are not of one freeze."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from handpipe.core import artifacts, metrics
from handpipe.core.configuration.loading import load_yaml
from handpipe.core.errors import InputError
from handpipe.develop.judge import ROWS, HandKinds, figures_by_hand, main, read_record, require_freeze

ROOT = Path(__file__).parents[2]
KINDS = ROOT / "config" / "judge.yaml"

SKIN = {"m0": 0.2, "m1": 0.5, "m2": 0.4, "m3": 0.3}  # mm, of the first hand, held out, to the true skin


def hand(root: Path, name: str, size: float = 1.0, commit: str = "a" * 40) -> Path:
    """A hand whose figures are `size` times those of the first one."""
    folder = root / name
    artifacts.write(folder / "rig.h5", {"x": 1.0}, kind="toy", attributes={"commit": commit})
    stages: dict[str, metrics.Metrics] = {}
    for _, stage, figure in ROWS:
        value = 0.1 if not figure.startswith("m") else SKIN[figure[:2]]
        stages.setdefault(stage, {})[figure] = (size * value, "mm")
    for stage, found in stages.items():
        metrics.write(folder / "metrics" / f"{stage}.json", found)
    return folder


def frozen(tag: str) -> str:
    """An empty commit under a tag, in the repository of the working directory."""
    person = ("-c", "user.name=a", "-c", "user.email=a@b")
    for command in (
        ("init", "-q"),
        (*person, "commit", "-q", "--allow-empty", "-m", tag),
        ("tag", tag),
    ):
        subprocess.run(("git", *command), check=True)
    found = subprocess.run(("git", "rev-parse", "HEAD"), capture_output=True, text=True, check=True)
    return found.stdout.strip()


def judged(root: Path, *folders: Path) -> tuple[int, Path, Path]:
    figures, page = root / "judge.json", root / "page.md"
    given = [*map(str, folders), "--kinds", str(KINDS), "--figures", str(figures), "--page", str(page)]
    return main(given), figures, page


def test_figures_are_means_spread_and_worst_of_the_test_hands(tmp_path: Path) -> None:
    """Three times the errors: the same ratio of models. The validation hand has a table of its own."""
    first, second = hand(tmp_path, "hand-child"), hand(tmp_path, "hand-woman", 3.0)
    (second / "complete.json").write_text("{}")
    code, figures, page = judged(tmp_path, first, second, hand(tmp_path, "phantom-hand-preview", 50.0))
    found = {name: entry["value"] for name, entry in json.loads(figures.read_text()).items()}
    assert code == 0
    assert (found["hands"], found["hands_complete"]) == (2, 1)
    assert found["m0_over_best_heldout"] == pytest.approx(0.2 / 0.3)
    assert found["heldout_skin_mean_worst_hand"] == pytest.approx(0.6)
    assert found["heldout_muscle_mean"] == pytest.approx(0.2)
    assert found["heldout_muscle_max"] == pytest.approx(0.3)
    assert found["baselines_m2_true_heldout_error_mean_over_hands_mean"] == pytest.approx(0.8)
    assert found["baselines_m2_true_heldout_error_mean_over_hands_sd"] == pytest.approx(0.8 / 2**0.5)
    assert found["hand-woman: muscles_heldout_surface_error_mean"] == pytest.approx(0.3)
    tests, validation = page.read_text().split("## Validation hands")
    assert "| m0, skin to true skin, held out | 0.2 | 0.6 | 0.4 | 0.283 |" in tests
    assert "| m0, skin to true skin, held out | 10 |" in validation
    assert "| built to its end (1), or a frame of its scenes failed (0) | 0 | 1 | 0.5 |" in tests
    assert "no freeze was stated" in tests


def test_hands_of_one_freeze_are_gathered_over_several_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two runs of one hand each, one folder gone, are one run of both. A new freeze begins anew."""
    (tmp_path / "repository").mkdir()
    monkeypatch.chdir(tmp_path / "repository")
    commit = frozen("freeze-1")
    given = ("--kinds", str(KINDS), "--figures", "judge.json", "--page", "page.md", "--record", "record.json")
    woman = hand(tmp_path, "hand-woman", 3.0, commit=commit)
    both = [str(woman), str(hand(tmp_path, "hand-child", commit=commit))]
    assert main([*both, *given, "--freeze", "freeze-1"]) == 0
    at_once = json.loads(Path("judge.json").read_text()), Path("page.md").read_text()
    Path("record.json").unlink()
    assert main([str(woman), *given, "--freeze", "freeze-1"]) == 0
    shutil.rmtree(woman)
    assert main([both[1], *given, "--freeze", "freeze-1"]) == 0
    assert (json.loads(Path("judge.json").read_text()), Path("page.md").read_text()) == at_once
    assert at_once[0]["hands"]["value"] == 2

    later = frozen("freeze-2")
    assert main([str(hand(tmp_path, "hand-left", commit=later)), *given, "--freeze", "freeze-2"]) == 0
    assert json.loads(Path("judge.json").read_text())["hands"]["value"] == 1


def test_coverage_counts_the_hands_that_have_it(tmp_path: Path) -> None:
    first, second = hand(tmp_path, "hand-child"), hand(tmp_path, "hand-woman")
    third = hand(tmp_path, "hand-left")
    for folder, share in ((first, 0.9), (third, 1.0)):
        covered = {"coverage_two_deviations_heldout": (share, "1")}
        metrics.write(folder / "metrics" / "deviations.json", covered)
    code, figures, page = judged(tmp_path, first, second, third)
    found = {name: entry["value"] for name, entry in json.loads(figures.read_text()).items()}
    assert code == 0
    assert (found["coverage_two_deviations"], found["coverage_hands"]) == (pytest.approx(0.95), 2)
    row = "| within two stated deviations, held out, mean of the kinds | 0.9 |  | 1 | 0.95 | 0.0707 |"
    assert row in page.read_text()


def test_a_record_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "record.json").write_text('{"commit": "a", "hands": {"hand-child": [1]}}')
    with pytest.raises(InputError, match=r"record.json: hands: is no record"):
        read_record(tmp_path / "record.json", "a")


def test_hands_of_two_builds_are_refused(tmp_path: Path) -> None:
    code, figures, page = judged(
        tmp_path, hand(tmp_path, "hand-child"), hand(tmp_path, "hand-left", commit="b" * 40)
    )
    assert code == 1
    assert not figures.exists() and not page.exists()


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("my-hand",), "neither a validation hand nor a test hand"),
        (
            ("zanatomy-hand", "zanatomy-hand-preview"),
            "zanatomy-hand and zanatomy-hand-preview: one hand twice",
        ),
        (("hand-child", "hand-child"), "hand-child: one hand twice"),
        (("phantom-finger",), "is no test hand"),
    ],
)
def test_a_hand_of_no_kind_a_hand_twice_and_validation_hands_alone_are_refused(
    names: tuple[str, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        load_yaml(KINDS, HandKinds).require([Path(name) for name in names])


def test_an_absent_figure_is_named(tmp_path: Path) -> None:
    folder = hand(tmp_path, "hand-child")
    (folder / "metrics" / "baselines.json").unlink()
    with pytest.raises(InputError, match=r"baselines.json: m0_example_error_mean: is not there"):
        figures_by_hand([folder])


def test_a_build_of_another_commit_than_the_freeze_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    commit = frozen("freeze-1")
    require_freeze(commit, "freeze-1")
    with pytest.raises(InputError, match="is not"):
        require_freeze("b" * 40, "freeze-1")
    with pytest.raises(InputError, match="is not there"):
        require_freeze(commit, "freeze-2")


def test_every_hand_has_a_dataset_file_and_one_kind() -> None:
    kinds = load_yaml(KINDS, HandKinds)
    folder = ROOT / "config" / "datasets"
    assert [
        name for name in (*kinds.validation, *kinds.test) if not (folder / f"{name}.yaml").is_file()
    ] == []
    assert not set(kinds.validation) & set(kinds.test)
