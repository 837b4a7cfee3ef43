"""Files that a person writes: from YAML to checked models."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ValidationError

from handpipe.core.artifacts import read_text
from handpipe.core.errors import InputError

T = TypeVar("T", bound=BaseModel)


def load_yaml(path: str | Path, model: type[T]) -> T:
    """Read and check a YAML file.

    Parameters
    ----------
    path : path
        File to read.
    model : class
        Pydantic model of its content.

    Returns
    -------
    model
        An instance of `model`.

    Raises
    ------
    InputError
        Where the file is missing or malformed, or a field is wrong; it names the first wrong field.
    """
    return checked(path, read_yaml(path), model)


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]  # C: 4 times as fast
    """YAML whose mappings have each key once: of two equal keys, the first would be lost silently."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: list[Any] = []
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                problem = f"the key {key!r} stands twice"
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            seen.append(key)
        return super().construct_mapping(node, deep)


def read_yaml(path: str | Path) -> Any:
    """The content of a YAML file; `InputError` where it is missing or malformed."""
    try:
        return yaml.load(read_text(path), Loader=_Loader) or {}  # a safe loader
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(path, "YAML", " ".join(str(error).split()), "Mend the syntax") from error


def checked(path: str | Path, content: Any, model: type[T]) -> T:
    """A model of the content of a file.

    Parameters
    ----------
    path : path
        The file, for messages.
    content : object
        What YAML or JSON gives.
    model : class
        Pydantic model of the content.

    Returns
    -------
    model
        An instance of `model`.

    Raises
    ------
    InputError
        Where a field is wrong; it names the first wrong field.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise _fault(path, error.errors()[0]) from error


def _fault(path: str | Path, found: Mapping[str, Any]) -> InputError:
    """One error of pydantic as one of ours."""
    problem = found["msg"].removeprefix("Value error, ")
    field = ".".join(str(p) for p in found["loc"] if p != "[key]")
    if found["type"] == "string_pattern_mismatch":
        problem = (
            f"{found['input']!r} is no name: letters a to z, digits and {_joint_of(found)}, letter first"
        )
    if not field:  # checks of a whole file name the field themselves
        field, _, problem = problem.partition(": ") if ": " in problem else ("content", "", problem)
    return InputError(path, field, problem, "See config/README.md")


def every_fault(error: InputError) -> list[InputError]:
    """All that is wrong with the fields of a file, of which loading names the first.

    Parameters
    ----------
    error : InputError
        What `load_dataset`, `load_scene` or `settings_of` raised.

    Returns
    -------
    list of InputError
        `error` alone where it is of another kind.
    """
    if not isinstance(error.__cause__, ValidationError):
        return [error]
    return [_fault(error.source, found) for found in error.__cause__.errors()]


def _joint_of(error: Mapping[str, Any]) -> str:
    """The character allowed beside letters and digits in the pattern of names that an error names."""
    return "hyphens" if "-]" in error["ctx"]["pattern"] else "underscores"
