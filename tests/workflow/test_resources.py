"""Jobs ask a cluster for the memory and the time that meshes of their size take."""

import re
from pathlib import Path

import pytest

from .running import run, working_copy

SHOW = """
for each in workflow.rules:
    if not each.resources["mem_mb"].is_evaluable():
        print("asks", each.name, each.resources["mem_mb"].value)
"""
# MiB, measured on the embedded hand at `paper`: the most that a job of the rule took (docs/fidelity.md)
TAKEN = {
    "make_bone_fascia": 3240,
    "make_muscle_fascia": 1519,
    "separate_muscles": 1908,
    "separate_neutral": 1676,
    "fit_fat_strains": 4505,
}
FINE_FLESH = 2578  # likewise, at 1.7 mm


@pytest.fixture
def asked(tmp_path: Path):  # type: ignore[no-untyped-def]
    """MiB that rules ask for, by rule, with further settings."""
    folder = working_copy(tmp_path)
    with open(folder / "Snakefile", "a", encoding="utf-8") as file:
        file.write(SHOW)

    def ask(*settings: str) -> dict[str, int]:
        said = run(folder, "-n", "--config", *settings).stdout
        shown = re.findall(r"^asks (\w+) (\d+)$", said, re.MULTILINE)
        assert shown, said
        return {name: int(size) for name, size in shown}

    return ask


def test_memory_grows_with_the_meshes(asked) -> None:  # type: ignore[no-untyped-def]
    preview, standard, paper = (asked(f"fidelity={word}") for word in ("preview", "standard", "paper"))
    finer = asked("fidelity=preview", "edges={fat: 1.7}")
    for rule, taken in TAKEN.items():
        assert preview[rule] < standard[rule] < paper[rule]
        assert taken < paper[rule] < 2 * taken
    assert finer["fit_fat_strains"] == paper["fit_fat_strains"]
    assert paper["simulate_flesh"] == preview["simulate_flesh"]  # its mesh is the same
    assert FINE_FLESH < asked("edges={flesh: 1.7}")["simulate_flesh"] < 2 * FINE_FLESH
    assert finer["make_bone_fascia"] == preview["make_bone_fascia"]
    assert asked("fidelity=preview", "edges={fat: 6}")["fit_fat_strains"] == preview["fit_fat_strains"]
