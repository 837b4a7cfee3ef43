"""Docstrings of what faces export: numpydoc sections that agree with signatures."""

import argparse
import enum
import inspect
import re
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any, is_typeddict

import pydantic
import pytest
from tests.test_house import ROOMS, exports, name_of

SECTION = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)


def documented() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Functions and classes that a face exports, each at the first face that does."""
    seen: set[int] = set()
    for room in map(name_of, ROOMS):
        for name in sorted(exports(room)):
            thing = getattr(import_module(room), name)
            own = str(getattr(thing, "__module__", "")).startswith("handpipe") and callable(thing)
            if own and not inspect.ismodule(thing) and id(thing) not in seen and not is_plain(thing):
                seen.add(id(thing))
                yield f"{room}.{name}", thing


def is_plain(thing: object) -> bool:
    """Classes that nobody constructs by hand, or whose fields are documented one by one."""
    if not inspect.isclass(thing):
        return False
    bases = (enum.Enum, BaseException, pydantic.BaseModel, argparse.ArgumentParser)
    return issubclass(thing, bases) or is_typeddict(thing) or getattr(thing, "_is_protocol", False)


def sections(docstring: str) -> dict[str, str]:
    """Texts of the numpydoc sections by their titles."""
    parts = SECTION.split(inspect.cleandoc(docstring))
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def described(section: str) -> list[str]:
    """Names that a section of parameters describes, in order; several may share one line."""
    heads = re.findall(r"^(\*{0,2}\w+(?:, \*{0,2}\w+)*)(?: :.*)?$", section, re.MULTILINE)
    return [name.lstrip("*") for head in heads for name in head.split(", ")]


DOCUMENTED = dict(documented())


@pytest.mark.parametrize("name", DOCUMENTED)
def test_parameters_and_results_are_described(name: str) -> None:
    thing = DOCUMENTED[name]
    found = sections(thing.__doc__ or "")
    signature = inspect.signature(thing)
    assert described(found.get("Parameters", "")) == list(signature.parameters)
    returned = signature.return_annotation
    gives = not inspect.isclass(thing) and returned not in (None, "None", "NoReturn")
    assert bool({"Returns", "Yields"} & set(found)) == gives
    assert "Raises `" not in (thing.__doc__ or ""), "errors have a section of their own: Raises"
