"""A change reruns what reads it, in one call, and nothing else."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from benchmarks.trust.stale import CHANGES, Change, Workbench, unchecked_fields, workbench
from tests.sampling import every

from handpipe.skeleton.rig.rig import Rig

from .running import CHECKOUT, ENVIRONMENT, planned, run
from .small_subject import write_dataset

SMALL = ("--config", "subjects=[small]")


@pytest.fixture(scope="module")
def bench() -> Iterator[Workbench]:
    with workbench() as made:
        yield made


@pytest.mark.parametrize("change", every(4, CHANGES), ids=str)
def test_change_of_a_field_reruns_what_reads_it(bench: Workbench, change: Change) -> None:
    assert bench.unlike(change) == (set(), set())


def test_every_field_of_the_schemas_is_in_the_table() -> None:
    assert unchecked_fields() == set()


def test_jobs_have_all_parameters(bench: Workbench) -> None:
    """No rule is without the digest of its code."""
    plan = bench.before("person")
    hashes = [any(isinstance(p, str) and len(p) == 66 for p in c) for c in plan.compared.values()]
    assert sum(hashes) == len(hashes) - 1  # `all` runs nothing


@pytest.mark.parametrize("edge", ["2.5", 2.5, "25e-1"])
def test_a_number_of_the_command_line_is_that_of_the_file(bench: Workbench, edge: object) -> None:
    """config/finger.yaml has 2.5; Snakemake hands on what is inside braces as text."""
    given = bench.plan("person", edges={"fat": edge})
    assert given.rerun(bench.before("person")) == set()


def test_a_wrong_value_of_the_command_line_is_named(tmp_path: Path, small: Path) -> None:
    process = run(small, "-n", "all", "--config", "subjects=[small]", "edges={muscle: wide}")
    assert process.returncode != 0
    said = [line.strip() for line in process.stdout.splitlines() if "handpipe: " in line]
    assert len(said) == 1
    assert "edges.muscle: Input should be a valid number" in said[0]


def test_an_edit_of_the_library_reruns_what_imports_it(
    built_small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    shutil.copytree(CHECKOUT / "src", folder / "src")
    monkeypatch.setitem(ENVIRONMENT, "PYTHONPATH", str(folder / "src"))
    assert planned(folder, "segmentation", *SMALL) == {}
    claims = folder / "src/handpipe/imaging/segmentation/claims.py"
    claims.write_text(f"# A comment.\n{claims.read_text(encoding='utf-8')}", encoding="utf-8")
    assert planned(folder, "segmentation", *SMALL) == {}
    registration = folder / "src/handpipe/skeleton/registration/registration.py"
    registration.write_text(registration.read_text(encoding="utf-8") + "\nNEW = 1\n", encoding="utf-8")
    assert planned(folder, "segmentation", *SMALL) == {}
    looks = folder / "src/handpipe/evaluation/segmentation.py"
    looks.write_text(looks.read_text(encoding="utf-8") + "\nNEW = 1\n", encoding="utf-8")
    assert planned(folder, "segmentation", *SMALL) == {"evaluate_segmentation": 1, "segmentation": 1}


def test_a_changed_limit_is_in_the_rig_after_one_call(
    built_small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    assert run(folder, "-j2", "rig", *SMALL).returncode == 0
    file = folder / "config/datasets/small.yaml"
    subject = yaml.safe_load(file.read_text(encoding="utf-8"))
    subject["joints"]["hinge"]["limits_deg"] = [[-10, 80]]
    write_dataset(folder, subject)
    assert planned(folder, "rig", *SMALL) == {"check_subject": 1, "fit_rig": 1, "rig": 1}
    assert run(folder, "-j2", "rig", *SMALL).returncode == 0
    [[_, upper]] = [np.degrees(limit) for limit in Rig.load(folder / "results/small/rig.h5").limits.values()]
    assert upper == pytest.approx(80)
    assert planned(folder, "rig", *SMALL) == {}

    shutil.copytree(CHECKOUT / "src", folder / "src")
    monkeypatch.setitem(ENVIRONMENT, "PYTHONPATH", str(folder / "src"))
    registration = folder / "src/handpipe/skeleton/registration/registration.py"
    registration.write_text(registration.read_text(encoding="utf-8") + "\nNEW = 1\n", encoding="utf-8")
    assert planned(folder, "rig", *SMALL) == {"register_bones": 2, "fit_rig": 1, "rig": 1}


def test_the_page_states_how_many_fields_there_are() -> None:
    page = (Path(__file__).parents[2] / "docs/trust.md").read_text(encoding="utf-8")
    assert re.findall(r"`stale` has (\d+) fields today", page) == [str(len(CHANGES))]
