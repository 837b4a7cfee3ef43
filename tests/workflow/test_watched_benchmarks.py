"""Rules of benchmarks read what they declare: those that run in seconds are watched as other rules are.

Their Python is a process that the job starts, in which tests/workflow/watch runs, too.
"""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml

from handpipe.core import paths

from .running import CHECKOUT, run, watching, working_copy

LONG = "a part takes minutes to hours, with results of a whole finger or hand"
NOT_WATCHED = {
    "benchmark_anatomy": "53 s",
    "benchmark_truth": "more than two minutes and 4.5 GB",
    "benchmark_scans_part": LONG,
    "benchmark_trust_frames": LONG,
    "benchmark_trust_part": LONG,
    "benchmark_fidelity_part": LONG,
    "benchmark_layered_part": LONG,
    "benchmark_motions": "some thousands of frames of a whole hand",
    "benchmark_levels_part": LONG,
    "benchmark_levels_creases": LONG,
}
PARTS = {  # of what is merged: the first ones of each benchmark have a figure
    "scans": ("foot", "knee", "skin", "alignment", "effects", "chain", "from_raw"),
    "trust": ("solver", "frames", "seeds", "readers", "stale", "kills"),
    "fidelity": ("preview", "standard", "paper-fat", "paper"),
    "layered": ("cases", "random"),
    "levels": ("finger", "hand", "creases"),
}
SMALL = {  # arguments of a part in small sizes
    "fem": ["linear", "--quick"],
    "bones": ["five-poses", "--quick"],
    "shapes": ["string", "--quick"],
}
MEASURED = ("segmentation", "cluster", *SMALL)
SPACING = 1.2  # mm, of the seeded hand
FIDELITY = ("skin_true_heldout_error_mean", "frame_seconds_mean", "frame_seconds_max")


def write_parts(folder: Path) -> None:
    """Figures of parts, as if they had been measured."""
    for name, parts in PARTS.items():
        for number, part in enumerate(parts):
            names = [f"{part}_{figure}" for figure in FIDELITY] if name == "fidelity" else [f"{part}_seconds"]
            file = folder / paths.benchmark_of(f"{name}/{part}.json")
            file.parent.mkdir(parents=True, exist_ok=True)
            found = {figure: {"value": 1.0 + number, "unit": "1"} for figure in names}
            file.write_text(json.dumps(found), encoding="utf-8")


def make_small(folder: Path) -> None:
    """Coarse images of the seeded hand, and benchmarks with small sizes."""
    file = folder / "config/datasets/phantom-hand-seeded.yaml"
    hand = yaml.safe_load(file.read_text(encoding="utf-8")) | {"scanner": {"spacing": SPACING}}
    file.write_text(yaml.safe_dump(hand, sort_keys=False), encoding="utf-8")
    rules = folder / "workflow/rules/benchmarks.smk"
    text = rules.read_text(encoding="utf-8")
    for name, arguments in SMALL.items():
        text, count = re.subn(rf'(name="{name}",\s+arguments=)\[\]', rf"\g<1>{arguments}", text)
        assert count == 1
    given = '"--poses", *BENCHMARK_POSES'
    assert given in text
    text = text.replace(given, f'{given}, "--bones", "proximal2", "--repeats", "1"')
    rules.write_text(text, encoding="utf-8")


@pytest.fixture(scope="module")
def jobs(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What each job of the benchmarks read, and the processes that it started."""
    folder = working_copy(tmp_path_factory.mktemp("benchmarks") / "copy")
    shutil.copytree(
        CHECKOUT / "benchmarks", folder / "benchmarks", ignore=shutil.ignore_patterns("__pycache__")
    )
    write_parts(folder)
    make_small(folder)
    (folder / "watched").mkdir()
    merged = ("scans", "trust", "layered")
    files = [paths.benchmark_of(f"{name}.json") for name in merged]
    drawn = ("fidelity", "levels")
    files += [paths.benchmark_of(f"{name}.png") for name in drawn]
    rules = [f"benchmark_{name}" for name in (*merged, *drawn, *(f"{name}_figures" for name in drawn))]
    for targets in (
        (*files, "--allowed-rules", *rules),
        [f"benchmark_{name}" for name in MEASURED],
    ):
        process = run(folder, "-j2", *targets, environment=watching(folder / "watched"))
        assert process.returncode == 0, process.stdout[-5000:]
    return [json.loads(path.read_text(encoding="utf-8")) for path in (folder / "watched").glob("*.json")]


def test_benchmarks_read_no_file_that_their_rules_do_not_declare(jobs: list[dict[str, Any]]) -> None:
    assert [job for job in jobs if job["undeclared"]] == []


def test_every_benchmark_is_watched_or_has_a_reason(jobs: list[dict[str, Any]]) -> None:
    text = (CHECKOUT / "workflow/rules/benchmarks.smk").read_text(encoding="utf-8")
    known = set(re.findall(r"^rule (benchmark_\w+):", text, flags=re.MULTILINE))
    assert known - {job["rule"] for job in jobs} == set(NOT_WATCHED)
