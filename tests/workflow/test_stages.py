"""Stages are functions of the library; rules name the same files as they do."""

import ast
import contextlib
import importlib
import inspect
import re
import shutil
from dataclasses import fields
from pathlib import Path

import pytest

from handpipe.core import artifacts
from handpipe.stages.files import Files

from .running import CHECKOUT

SOURCE = CHECKOUT / "src"
SCRIPTS = CHECKOUT / "workflow" / "scripts"
HOW_TO = CHECKOUT / "docs" / "how-to" / "call-a-stage.md"


def stages() -> dict[str, str]:
    """The module of each stage by its name."""
    found = {}
    for script in SCRIPTS.glob("*.py"):
        named = re.search(r"from (handpipe\.stages\.\w+\.(\w+)) import", script.read_text(encoding="utf-8"))
        if named:
            assert named[2] == script.stem
            found[named[2]] = named[1]
    return found


def rules() -> dict[str, str]:
    """Text of every rule that runs a stage, by the rule's name and its script."""
    found = {}
    for path in sorted((CHECKOUT / "workflow" / "rules").glob("*.smk")):
        for text in re.split(r"^rule ", path.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]:
            script = re.search(r"scripts/(\w+)\.py", text)
            if script and script[1] in stages():
                found[f"{text.split(':')[0]} {script[1]}"] = text
    return found


def names_in(text: str, field: str) -> list[str]:
    """Names that a rule gives to its input or output files."""
    block = re.search(rf"^    {field}:\n((?: {{8}}.*\n|\n)*)", text, re.MULTILINE)
    return re.findall(r"^ {8}(\w+)=", block[1], re.MULTILINE) if block else []


@pytest.mark.parametrize("rule", rules())
def test_a_rule_names_the_files_of_its_stage(rule: str) -> None:
    text, module = rules()[rule], importlib.import_module(stages()[rule.split()[1]])
    for kind in ("Inputs", "Outputs"):
        if record := getattr(module, kind, None):
            assert names_in(text, kind.lower()[:-1]) == [field.name for field in fields(record)]


@pytest.mark.parametrize("name", stages())
def test_a_stage_is_a_function_with_few_arguments(name: str) -> None:
    function = getattr(importlib.import_module(stages()[name]), name)
    assert inspect.isfunction(function)
    assert len(inspect.signature(function).parameters) <= 7


def test_scripts_hold_no_code_of_their_own() -> None:
    """All but the log, the errors and the process of a benchmark is in the library."""
    others = {path.stem for path in SCRIPTS.glob("*.py")} - set(stages())
    assert others == {"common", "benchmark"}
    for name in stages():
        run = ast.parse((SCRIPTS / f"{name}.py").read_text(encoding="utf-8")).body[-1]
        if isinstance(run, ast.If) and ast.unparse(run.test) == "__name__ == '__main__'":
            [run] = run.body  # a process that the stage starts imports the script, too
        assert isinstance(run, ast.With)
        assert [type(statement) for statement in run.body] == [ast.ImportFrom, ast.Expr], name


def test_files_take_the_names_of_their_record() -> None:
    record = importlib.import_module(stages()["extract_muscle"]).Inputs
    given = {"rig": "a.h5", "templates": "b.h5", "volume": "c.nii", "markers": [], "landmarks": "d.json"}
    made = record.named(given)
    assert (made.rig, made.markers, made.landmarks) == (Path("a.h5"), None, Path("d.json"))
    assert made.all() == [Path(name) for name in ("a.h5", "b.h5", "c.nii", "d.json")]


@pytest.mark.parametrize(
    "change", [{"surplus": "e.h5"}, {"rig": None}, {"rig": ["a.h5", "b.h5"]}, {"rig": []}], ids=str
)
def test_files_of_other_names_or_numbers_raise(change: dict[str, object]) -> None:
    record: type[Files] = importlib.import_module(stages()["extract_muscle"]).Inputs
    given = {"rig": "a.h5", "templates": "b.h5", "volume": "c.nii", "markers": [], "landmarks": []}
    with pytest.raises(TypeError):
        record.named({**given, **change})


def test_the_how_to_calls_a_stage(built_small: Path, tmp_path: Path) -> None:
    """Its example registers the bones of the small subject, which stands in place of the finger."""
    examples = re.findall(r"```python\n(.*?)```", HOW_TO.read_text(encoding="utf-8"), re.DOTALL)
    [code] = [example for example in examples if "handpipe.stages" in example]
    code = code.replace("phantom-finger", "small").replace('"fist"', '"bent"')
    folder = Path(shutil.copytree(built_small, tmp_path / "copy"))
    with contextlib.chdir(folder):
        exec(code, {})
        found = artifacts.read(folder / "fist-again.h5", "registration")
        recorded = artifacts.read_attributes(folder / "fist-again.h5")
    assert set(found) == {"near", "far"}
    assert "results/small/segmentation/bent/surfaces.h5" in recorded["inputs"]
    assert "rule" not in recorded
