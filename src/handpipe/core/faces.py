"""Faces of packages: a name that others may import is looked up in its module when it is first asked for.

A package imports the names of its face under `if TYPE_CHECKING`, lists them in `__all__`, and has the
`__getattr__` that `face` makes otherwise. So importing a package loads none of its modules, and tools see the
type of every name.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def face(package: str) -> Callable[[str], Any]:
    """The `__getattr__` of a package, by its `__name__`."""

    @cache
    def modules() -> dict[str, str]:
        return exports(Path(str(sys.modules[package].__file__)))

    def look_up(name: str) -> Any:
        if name not in modules():
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = modules()[name]
        if module == package:
            return import_module(f"{package}.{name}")
        found = getattr(import_module(module), name)
        setattr(sys.modules[package], name, found)
        return found

    return look_up


def exports(path: Path) -> dict[str, str]:
    """The module of each name that a package's `__init__` imports under `if TYPE_CHECKING`."""
    return {
        alias.name: str(node.module)
        for block in ast.parse(path.read_bytes()).body
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
