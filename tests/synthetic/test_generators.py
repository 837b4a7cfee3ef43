"""The registry of generators, and what it asks of a dataset file before any job."""

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
import yaml

from handpipe.cli import main
from handpipe.core.configuration import load_dataset
from handpipe.core.errors import InputError
from handpipe.synthetic import generators
from handpipe.synthetic.generators import GENERATORS

CHECKOUT = Path(__file__).parents[2]
SOURCE = CHECKOUT / "src" / "handpipe"
DATASETS = sorted((CHECKOUT / "config" / "datasets").glob("*.yaml"))
Content = dict[str, Any]


@pytest.mark.parametrize("path", DATASETS, ids=lambda p: p.stem)
def test_shipped_datasets_have_what_their_generators_need(path: Path) -> None:
    generators.require_known(path, load_dataset(path))


def test_each_generator_has_a_dataset_that_ships() -> None:
    assert {load_dataset(path).generator for path in DATASETS} == set(GENERATORS)


@pytest.mark.parametrize("name", [name for name, record in GENERATORS.items() if record.module])
def test_the_module_of_a_generator_makes_poses_and_templates(name: str) -> None:
    module = import_module(GENERATORS[name].module or "")
    assert callable(module.generate_pose) and callable(module.generate_templates)


def written(folder: Path, change: Callable[[Content], object]) -> Path:
    """The finger's dataset file with a change."""
    content = yaml.safe_load((CHECKOUT / "config/datasets/phantom-finger.yaml").read_text(encoding="utf-8"))
    change(content)
    path = folder / "phantom-finger.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


LIMB = {"volumes": {"neutral": "a.nii.gz"}, "strokes": "b.json"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.update(generator="phantom-foot"), "generator: 'phantom-foot' is no generator; .*finger"),
        (lambda c: c.update(scanner={"spacing": 1.0}), "scanner: is only for the generators phantom-hand, "),
        (
            lambda c: (c.pop("generator"), c.update(scanner={"spacing": 1.0})),
            "scanner: is only for the generators phantom-hand, ",
        ),
        (lambda c: c.update(proportions="giant"), "proportions: 'giant' is no measured person"),
        (lambda c: c.update(proportions="child"), "proportions: is only for the generators phantom-hand-com"),
        (
            lambda c: c.update(generator="real-limb", anatomy="feet"),
            "limb: is not given, but the generator real-limb needs it",
        ),
        (
            lambda c: c.update(generator="zanatomy-index"),
            "anatomy: is not given, but the generator zanatomy-index needs it",
        ),
    ],
)
def test_what_a_generator_cannot_use_is_refused_by_file_and_field(
    tmp_path: Path, change: Callable[[Content], object], message: str
) -> None:
    path = written(tmp_path, change)
    with pytest.raises(InputError, match=rf"phantom-finger\.yaml: {message}"):
        generators.require_known(path, load_dataset(path))


def test_the_command_names_an_unknown_generator(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for folder in ("config/datasets", "workflow"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "Snakefile").touch()
    written(tmp_path / "config/datasets", lambda c: c.update(generator="phantom-foot"))
    monkeypatch.chdir(tmp_path)
    assert main(["check", "phantom-finger"]) == 1
    said = capsys.readouterr().err
    assert "phantom-finger.yaml: generator: 'phantom-foot' is no generator" in said
    assert said.count("handpipe: ") == 1
    assert all(name in said for name in GENERATORS)


def test_a_stage_of_an_unknown_generator_or_of_none_raises() -> None:
    finger = load_dataset(CHECKOUT / "config/datasets/phantom-finger.yaml")
    for name in ("phantom-foot", None, "real-limb"):
        with pytest.raises(InputError, match="phantom-finger: generator: "):
            generators.generator_of(finger.model_copy(update={"generator": name}))


def test_no_package_below_knows_a_generator_by_name() -> None:
    """Nor do the rules: both read its record."""
    knowing = []
    for path in sorted(SOURCE.rglob("*.py")):
        if path.relative_to(SOURCE).parts[0] == "synthetic":
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        values = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
        knowing += [f"{path}: {name}" for name in GENERATORS if name in values]
    for path in (CHECKOUT / "Snakefile", *(CHECKOUT / "workflow").rglob("*.smk")):
        text = path.read_text(encoding="utf-8")
        knowing += [f"{path}: {name}" for name in GENERATORS if f'generator == "{name}"' in text]
    assert knowing == []
