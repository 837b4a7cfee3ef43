"""README is short, its links exist, and Snakemake accepts each of its commands."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from tests.workflow.running import CHECKOUT, snakemake, working_copy

from handpipe.core.configuration import load_dataset

README = (CHECKOUT / "README.md").read_text(encoding="utf-8")
TUTORIAL = (CHECKOUT / "docs" / "tutorial.md").read_text(encoding="utf-8")
PAGES = [
    (CHECKOUT / "docs" / name).read_text(encoding="utf-8")
    for name in ("scans.md", "trust.md", "how-to/knee.md")
]
CITED = re.compile(r"\b00[0-4]\b (section|Eq|Table|Fig|chapter|App)")


def commands(text: str) -> list[str]:
    """Snakemake's commands in code blocks and between backticks, without comments."""
    blocks = re.findall(r"^```\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    lines = [line.split("  #")[0].strip() for block in blocks for line in block.splitlines()]
    found = [line for line in lines if line.startswith("snakemake")] + re.findall(
        r"`(snakemake [^`]+)`", text
    )
    return [command for command in dict.fromkeys(found) if "my-hand" not in command]


def block(text: str, language: str) -> str:
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)[0]


def dry_run(folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    given = re.sub(
        r" --report \S+", "", command
    )  # tests/workflow/test_declared_files.py makes one, of a build
    return snakemake(folder, *shlex.split(given)[1:], "-n", "--quiet", "rules")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the workflow with the scenes of README and of the tutorial, the knee's images beside it."""
    beside = tmp_path_factory.mktemp("readme")
    folder = working_copy(beside / "checkout")
    knee = load_dataset(CHECKOUT / "config" / "datasets" / "knee.yaml")
    images = beside / knee.anatomy.relative_to("..")
    images.mkdir(parents=True)
    for volume in knee.limb.volumes.values():
        (images / volume).touch()
    shutil.copytree(CHECKOUT / "tests" / "data", folder / "tests" / "data")
    for text, scene in ((README, "pinch"), (TUTORIAL, "my-pinch")):
        (folder / f"config/scenes/{scene}.csv").write_text(block(text, "csv"))
        (folder / f"config/scenes/{scene}.yaml").write_text(block(text, "yaml"))
    return folder


def test_readme_has_at_most_900_words() -> None:
    assert len(README.split()) <= 900


def test_links_of_readme_exist() -> None:
    links = [link for link in re.findall(r"\]\(([^)#\s]+)", README) if "://" not in link]
    assert len(links) > 10
    assert [link for link in links if not (CHECKOUT / link).exists()] == []


@pytest.mark.parametrize("command", [c for text in (README, TUTORIAL, *PAGES) for c in commands(text)])
def test_snakemake_accepts_the_command(command: str, folder: Path) -> None:
    process = dry_run(folder, command)
    assert process.returncode == 0, process.stdout


def test_scene_of_readme_is_simulated_in_one_job(folder: Path) -> None:
    process = dry_run(
        folder, "snakemake -j2 simulation --configfile config/finger.yaml --config 'scenes=[pinch]'"
    )
    assert re.search(r"^simulate\s+1$", process.stdout, re.MULTILINE), process.stdout


def test_make_has_the_targets_that_readme_names() -> None:
    makefile = (CHECKOUT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    assert {
        *re.findall(r"`make ([\w-]+)`", README),
        *re.findall(r"^make ([\w-]+)", README, re.MULTILINE),
    } <= targets


def test_papers_are_cited_by_author_and_year() -> None:
    files = [p for part in ("src", "workflow", "docs") for p in (CHECKOUT / part).rglob("*")]
    texts = [p for p in [*files, CHECKOUT / "README.md"] if p.suffix in (".py", ".smk", ".md", ".json")]
    assert [str(p) for p in texts if CITED.search(p.read_text(encoding="utf-8"))] == []
