"""Examples in docstrings give what they say."""

import doctest
import importlib
from pathlib import Path

import pytest

import handpipe

SOURCE = Path(handpipe.__file__).parent
FILES = [path for path in sorted(SOURCE.rglob("*.py")) if ">>> " in path.read_text(encoding="utf-8")]


def name_of(path: Path) -> str:
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


def test_there_are_examples() -> None:
    assert FILES


@pytest.mark.parametrize("name", map(name_of, FILES))
def test_examples_of_a_module(name: str) -> None:
    failed, tried = doctest.testmod(importlib.import_module(name))
    assert tried
    assert failed == 0
