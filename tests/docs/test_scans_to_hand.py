"""The commands of the tutorial from raw scans: run up to the check, planned from there."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from tests.workflow.running import CHECKOUT, ENVIRONMENT, working_copy

from handpipe.core.configuration import load_dataset

TEXT = (CHECKOUT / "docs/scans-to-hand.md").read_text(encoding="utf-8")
PROGRAMS = {"handpipe": ["-m", "handpipe.cli"], "snakemake": ["-m", "snakemake"], "python": []}
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)
LINES = [line for language, block in BLOCKS if not language for line in block.splitlines()]


def called(folder: Path, line: str) -> str:
    """What a command of the page says; it has to succeed."""
    program, *arguments = shlex.split(line)
    process = subprocess.run(
        [sys.executable, *PROGRAMS[program], *arguments],
        cwd=folder,
        env=ENVIRONMENT,
        text=True,
        capture_output=True,
        check=False,
    )
    assert process.returncode == 0, process.stdout + process.stderr
    return process.stdout


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder where all commands up to the check have run, and what the check said."""
    folder = working_copy(tmp_path_factory.mktemp("scans"))
    said = [called(folder, line) for line in LINES[1 : LINES.index("handpipe check my-finger") + 1]]
    return folder, said[-1]


def test_the_page_builds_with_commands_that_are_known() -> None:
    assert {line.split()[0] for line in LINES} == {"source", *PROGRAMS}


@pytest.mark.slow
def test_nothing_is_wrong_with_the_raw_scans(checked: tuple[Path, str]) -> None:
    folder, said = checked
    assert said == "my-finger: nothing is wrong\n"
    dataset = load_dataset(folder / "config/datasets/my-finger.yaml")
    assert dataset.heldout == ["half", "reach"] and len(dataset.examples) == 5


@pytest.mark.slow
@pytest.mark.parametrize("line", [line for line in LINES if line.startswith("handpipe build")])
def test_the_builds_are_planned(checked: tuple[Path, str], line: str) -> None:
    said = called(checked[0], line.replace("handpipe build", "handpipe status"))
    assert re.match(r"my-finger: 0 of \d+ jobs are done", said)
    assert "propose_seeds" in said  # no strokes in the other poses
