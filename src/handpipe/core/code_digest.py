"""A digest of the code that a script runs: of its own and of every module of the packages that it imports.

Comments, docstrings and formatting do not count, nor does code under `if TYPE_CHECKING`, which never runs.
A name that is imported from a package's face (its `__init__`) counts as the module behind the name; a package
that is imported as a whole counts as all that its face exports.
"""

from __future__ import annotations

import ast
import hashlib
import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TypeGuard

from handpipe.core.artifacts import write_text


@dataclass(frozen=True)
class Module:
    """What the digest takes from one file.

    Parameters
    ----------
    digest : str
        Digest of its code.
    names : tuple of str
        Dotted names that it may import.
    exports : tuple of str
        Dotted names that it imports under `if TYPE_CHECKING`, which the face of a package looks up when
        another module imports them.
    """

    digest: str
    names: tuple[str, ...]
    exports: tuple[str, ...] = ()


@dataclass
class CodeDigests:
    """Digests of scripts over packages.

    Parameters
    ----------
    packages : tuple of path
        Folders of packages, each imported by its folder's name.
    cache : path, optional
        JSON file with what was found in each file, by the hash of its bytes; `save` writes it.
    _imports : dict of path to list of path
        Files of the packages that each file imports, as found so far; callers leave it out.
    """

    packages: tuple[Path, ...]
    cache: Path | None = None
    _imports: dict[Path, list[Path]] = field(default_factory=dict)

    def digest(self, *paths: Path) -> str:
        """Digest of files and of every file that they import, directly or through others."""
        if paths not in self._digests:
            found = self.modules(paths)
            lines = [self._line(path) for path in found]
            for folder in {path.parent for path in found}:
                lines += self._data_in(folder)
            self._digests[paths] = _hash("\n".join(sorted(lines)).encode())
        return self._digests[paths]

    def modules(self, paths: Iterable[Path]) -> frozenset[Path]:
        """The files and every file of the packages that they import, directly or through others."""
        pending = [*paths]
        first = tuple(pending)
        if first not in self._closures:
            found: set[Path] = set()
            while pending:
                path = pending.pop()
                if path not in found:
                    found.add(path)
                    pending += self._imported(path)
            self._closures[first] = frozenset(found)
        return self._closures[first]

    def module(self, name: str) -> Path:
        """The file of a module of the packages.

        Parameters
        ----------
        name : str
            Dotted name of the module.

        Returns
        -------
        path

        Raises
        ------
        KeyError
            For a module of no package.
        """
        return self._index[name]

    def _imported(self, path: Path) -> list[Path]:
        """Files that one file imports: modules of the packages, their packages, and files beside it."""
        if path not in self._imports:
            found: set[Path] = set()
            for name in self._module(path).names:
                found |= self._behind(name)
                top = name.partition(".")[0]
                beside = path.with_name(f"{top}.py")
                if top not in self._tops and beside.is_file():
                    found.add(beside)
            self._imports[path] = sorted(found)
        return self._imports[path]

    def _behind(self, name: str) -> set[Path]:
        """Files that run when a dotted name is imported: its packages and the modules that faces look up."""
        parts = name.split(".")
        known = [w for i in range(len(parts)) if (w := ".".join(parts[: i + 1])) in self._index]
        found = {self._index[w] for w in known}
        if known and self._index[known[-1]].name == "__init__.py":
            rest = parts[len(known[-1].split(".")) :]
            for export in self._module(self._index[known[-1]]).exports:
                if not rest or rest[0] in ("*", export.rpartition(".")[2]):
                    found |= self._behind(export)
        return found

    @cached_property
    def _tops(self) -> set[str]:
        return {folder.name for folder in self.packages}

    @cached_property
    def _index(self) -> dict[str, Path]:
        """Every module of the packages by its dotted name."""
        found = {}
        for folder in self.packages:
            for path in folder.rglob("*.py"):
                parts = path.relative_to(folder.parent).with_suffix("").parts
                found[".".join(parts).removesuffix(".__init__")] = path
        return found

    def save(self) -> None:
        """Write the cache, if anything is new and its folder can be written to."""
        if self.cache is not None and self._new:
            content = {key: [m.digest, m.names, m.exports] for key, m in (self._known | self._new).items()}
            with suppress(OSError):
                write_text(self.cache, json.dumps(content))

    @cached_property
    def _new(self) -> dict[str, Module]:
        return {}

    @cached_property
    def _known(self) -> dict[str, Module]:
        try:
            content = json.loads(self.cache.read_text(encoding="utf-8")) if self.cache else {}
            return {
                key: Module(d, tuple(names), tuple(exports)) for key, (d, names, exports) in content.items()
            }
        except (OSError, ValueError):
            return {}

    def _module(self, path: Path) -> Module:
        if path not in self._files:
            content = path.read_bytes()
            key = _hash(sys.version.encode() + content)
            found = self._known.get(key) or self._new.get(key)
            if found is None:
                found = self._new[key] = _read(content)
            self._files[path] = found
        return self._files[path]

    @cached_property
    def _files(self) -> dict[Path, Module]:
        return {}

    # Of the many jobs of a rule most run the same code.
    @cached_property
    def _digests(self) -> dict[tuple[Path, ...], str]:
        return {}

    @cached_property
    def _closures(self) -> dict[tuple[Path, ...], frozenset[Path]]:
        return {}

    def _line(self, path: Path) -> str:
        """Name and digest of a file of code."""
        if path not in self._lines:
            self._lines[path] = f"{self._name(path)} {self._module(path).digest}"
        return self._lines[path]

    @cached_property
    def _lines(self) -> dict[Path, str]:
        return {}

    def _data_in(self, folder: Path) -> list[str]:
        """Names and digests of the files in a package's folder that are no code, for instance templates."""
        if folder not in self._data:
            self._data[folder] = [
                f"{self._name(path)} {_hash(path.read_bytes())}"
                for path in (folder.iterdir() if (folder / "__init__.py").is_file() else ())
                if path.is_file() and path.suffix not in (".py", ".pyc")
            ]
        return self._data[folder]

    @cached_property
    def _data(self) -> dict[Path, list[str]]:
        return {}

    def _name(self, path: Path) -> str:
        """A file's name, the same wherever the folders lie."""
        for folder in self.packages:
            if path.is_relative_to(folder):
                return path.relative_to(folder.parent).as_posix()
        return path.name


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _read(content: bytes) -> Module:
    tree = ast.parse(content)
    exports = [
        name for node in tree.body if _is_for_types(node) for part in node.body for name in _names(part)
    ]
    tree.body = [
        part
        for node in tree.body
        for part in (node.orelse if _is_for_types(node) else [node])
        if not _is_list_of_exports(part)
    ]
    names = tuple(sorted(set(_names(tree))))
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [child for child in node.body if not _is_text(child)] or [ast.Pass()]
    return Module(_hash(ast.dump(tree).encode()), names, tuple(sorted(set(exports))))


def _is_for_types(node: ast.stmt) -> TypeGuard[ast.If]:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def _is_list_of_exports(node: ast.stmt) -> bool:
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"


def _is_text(node: ast.stmt) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _names(tree: ast.AST) -> Iterator[str]:
    """Dotted names that a file imports, inside functions too, or holds as text: modules that it runs."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and _is_dotted_name(node.value):
            yield str(node.value) + ".__main__"  # a package that is run is not all that its face exports


def _is_dotted_name(value: object) -> bool:
    return isinstance(value, str) and "." in value and value.replace(".", "_").isidentifier()
