"""The files that a stage reads or writes, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self, get_type_hints


@dataclass(frozen=True)
class Files:
    """Base of the records of files: each field is a path, a path or None, or a sequence of paths."""

    @classmethod
    def named(cls, files: Mapping[str, Any]) -> Self:
        """The record with the files of the given names: texts, paths, or sequences of these.

        An empty sequence stands for an optional file that is not given. Raises `TypeError` where names are
        not those of the record, or a file is missing.
        """
        return cls(**{name: cls._file(name, value) for name, value in files.items()})

    @classmethod
    def _file(cls, name: str, value: Any) -> Any:
        kind = get_type_hints(cls).get(name)
        one = isinstance(value, str | Path)
        if kind in (Path, Path | None):
            if one:
                return Path(value)
            if kind != Path and (value is None or not len(value)):
                return None
            raise TypeError(f"{cls.__module__}: {name} is one file, not {value!r}")
        return [Path(value)] if one else [Path(item) for item in value]

    def all(self) -> list[Path]:
        """Every file, in the order of the fields."""
        values = [getattr(self, field.name) for field in fields(self)]
        listed = [[v] if isinstance(v, Path) else v for v in values if v is not None]
        return [path for paths in listed for path in paths]
