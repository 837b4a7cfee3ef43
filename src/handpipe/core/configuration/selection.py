"""The part of a dataset or scene that one stage reads; any other field raises there.

A field is a path of names: "bones.*.label" is the label of every bone, "poses.{pose}.volume" a field of one
pose, "joints" all joints with all that they have, "muscles.names" the names of the muscles, "*" everything.
What a model computes of its fields can be selected by its name, as "neutral", without these fields.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from types import UnionType
from typing import Any, NoReturn, TypeVar, Union, get_args, get_origin

from pydantic import TypeAdapter
from pydantic_core import to_jsonable_python

from handpipe.core.configuration.model import Model, UndeclaredFieldError

M = TypeVar("M", bound=Model)
Paths = Sequence[tuple[str, ...]]
NAMES = "names"  # of the entries of a mapping, without their values
EVERY = "*"


def select(model: Model, fields: Sequence[str], **names: str | Sequence[str]) -> str:
    """The selected fields and their values as JSON text, the same for the same values.

    Parameters
    ----------
    model : Model
        Model of which a part is selected.
    fields : sequence of str
        Paths of names, as the module describes them.
    **names : str or sequence of str
        What replaces each "{…}" in the fields, by the name in braces; each of several selects a field.

    Returns
    -------
    str

    Raises
    ------
    ValueError
        For a field that the model does not have.
    """
    resolved = [path for field in fields for path in _resolved(field, names)]
    content = _selected(model, [tuple(path.split(".")) for path in resolved])
    return json.dumps({"fields": resolved, "values": content})


def restored(text: str, cls: type[M]) -> M:
    """The part of a model that `select` selected; reading any other field raises `UndeclaredFieldError`.

    Parameters
    ----------
    text : str
        JSON text that `select` returned.
    cls : class
        The model's class.

    Returns
    -------
    model
        An instance of `cls` with the selected fields alone.
    """
    stored = json.loads(text)
    found: M = _restored(cls, stored["values"], [tuple(path.split(".")) for path in stored["fields"]])
    return found


def _resolved(field: str, names: Mapping[str, str | Sequence[str]]) -> Iterator[str]:
    """The field for each of the names that stand for its first "{…}", and so on."""
    start, stop = field.find("{"), field.find("}")
    if start < 0:
        yield field
        return
    given = names[field[start + 1 : stop]]
    for name in [given] if isinstance(given, str) else given:
        yield from _resolved(field[:start] + name + field[stop + 1 :], names)


def _tails(paths: Paths, head: str) -> list[tuple[str, ...]]:
    return [path[1:] for path in paths if path[0] in (head, EVERY)]


def _selected(value: Any, paths: Paths) -> Any:
    if value is None or () in paths:
        return to_jsonable_python(value)
    heads = {path[0] for path in paths}
    if isinstance(value, Model):
        computed = [name for name in sorted(heads) if _is_computed(type(value), name)]
        unknown = heads - {*type(value).model_fields, *computed, EVERY}
        if unknown:
            raise ValueError(f"{type(value).__name__} has no field {', '.join(sorted(unknown))}")
        found = {
            name: _selected(getattr(value, name), tails)
            for name in type(value).model_fields
            if (tails := _tails(paths, name))
        }
        return found | {name: getattr(value, name) for name in computed}
    whole = _is_whole(heads)
    return {
        name: _selected(item, tails)
        for name, item in value.items()
        if (tails := _tails(paths, name)) or whole
    }


def _is_computed(kind: type[Model], name: str) -> bool:
    return isinstance(getattr(kind, name, None), cached_property)


def _is_whole(heads: set[str]) -> bool:
    """Whether every entry of a mapping is selected, and so its names may be listed."""
    return not heads.isdisjoint((EVERY, NAMES))


def _restored(annotation: Any, content: Any, paths: Paths) -> Any:
    if content is None:
        return None
    if () in paths:
        return TypeAdapter(annotation).validate_python(content)
    kind = _without_none(annotation)
    if get_origin(kind) is dict:
        inner = get_args(kind)[1]
        entries = {name: _restored(inner, item, _tails(paths, name)) for name, item in content.items()}
        return entries if _is_whole({path[0] for path in paths}) else SelectedEntries(entries)
    values = {
        name: _restored(kind.model_fields[name].annotation, item, _tails(paths, name))
        for name, item in content.items()
        if name in kind.model_fields
    }
    model = kind.model_construct(**values)
    model.__dict__.update({name: item for name, item in content.items() if name not in values})
    for name in set(kind.model_fields) - set(values):  # pydantic fills them with defaults
        model.__dict__.pop(name, None)
    return model


def _without_none(annotation: Any) -> Any:
    """The type X of an annotation `X | None`."""
    if get_origin(annotation) not in (Union, UnionType):
        return annotation
    [kind] = [a for a in get_args(annotation) if a is not type(None)]
    return kind


class SelectedEntries(dict[str, Any]):
    """Some entries of a mapping: each can be read by its name, but they can't be listed or counted."""

    def __missing__(self, name: str) -> NoReturn:
        """Raises an error: the script's rule does not declare the entry."""
        raise UndeclaredFieldError(f"the entry {name!r} is not declared by the rule of this script")

    def _refused(self, *_: object) -> NoReturn:
        raise UndeclaredFieldError(f"only {[*dict.keys(self)]} are declared by the rule of this script")

    __iter__: Callable[..., NoReturn] = _refused
    __len__: Callable[..., NoReturn] = _refused
    __contains__: Callable[..., NoReturn] = _refused
    keys: Callable[..., NoReturn] = _refused
    values: Callable[..., NoReturn] = _refused
    items: Callable[..., NoReturn] = _refused
    get: Callable[..., NoReturn] = _refused
