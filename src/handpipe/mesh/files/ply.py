"""The polygons of a PLY file of any dialect.

Any types, any properties before and after those that are read, both names of the list of indices, both
byte orders, text. meshio 5.3 refuses properties beside the list; trimesh 5.2 refuses binary polygons of
different sizes and splits vertices where texture coordinates do; both lose how a concave polygon is bounded.
"""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handpipe.core import Array, InputError, IntArray
from handpipe.mesh.files.polygons import Polygons

Bytes = NDArray[np.uint8]

log = logging.getLogger(__name__)

TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": "<"}
INDICES = ("vertex_indices", "vertex_index")
AGAIN = "Export the surface again"


@dataclass(frozen=True)
class Property:
    """A column: numpy type of its values and, for a list, of its length."""

    name: str
    values: np.dtype
    length: np.dtype | None = None


@dataclass(frozen=True)
class Element:
    """A number of rows with the same properties."""

    name: str
    count: int
    properties: list[Property]

    @property
    def least(self) -> int:
        """Bytes of a row whose lists are empty."""
        return sum((p.values if p.length is None else p.length).itemsize for p in self.properties)


def read_ply(path: str | Path) -> tuple[Array, Polygons]:
    """The vertices and polygons of a PLY file.

    Counts are compared with the file's size before memory for them is allocated.

    Parameters
    ----------
    path : path
        File to read.

    Returns
    -------
    vertices : array (n, 3)
        Positions in the file's order and unit.
    polygons : Polygons
        Polygons in the file's order.

    Raises
    ------
    InputError
        Where the file is malformed.
    """
    content = Path(path).read_bytes()
    elements, text, start = _header(path, content)
    if text:  # each number becomes eight bytes, so that text and binary files are read alike
        elements = [Element(e.name, e.count, [_as_text(p) for p in e.properties]) for e in elements]
        raw = _numbers(path, content[start:]).view(np.uint8)
    else:
        raw = np.frombuffer(content, dtype=np.uint8)[start:]
    return _body(path, elements, raw, text)


def _as_text(column: Property) -> Property:
    number = np.dtype("<f8")
    return Property(column.name, number, None if column.length is None else number)


def _numbers(path: str | Path, body: bytes) -> Array:
    try:
        return np.array(body.split(), dtype=np.float64)
    except ValueError as error:
        raise InputError(path, "content", f"has words among the numbers ({error})", AGAIN) from error


def _header(path: str | Path, content: bytes) -> tuple[list[Element], bool, int]:
    """The elements, whether the file is text, and at which byte the elements begin."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", content)
    if first is None:
        raise InputError(path, "content", "does not begin with 'ply'", "Give a PLY file, or its right suffix")
    last = re.search(rb"(?<=[\r\n])end_header[ \t]*" + first[1], content)
    if last is None:
        raise InputError(path, "header", "has no end: the line end_header is missing", AGAIN)
    lines = content[: last.start()].decode("latin-1").split(first[1].decode())[1:]
    order, text, elements = "", False, list[Element]()
    for number, line in enumerate(lines, start=2):
        words = line.split()
        try:
            if not words or words[0] in ("comment", "obj_info"):
                continue
            if words[0] == "format":
                order = ORDERS[words[1]]
                text = words[1] == "ascii"
            elif words[0] == "element":
                elements.append(Element(words[1], _count(words[2]), []))
            elif words[0] == "property":
                elements[-1].properties.append(_property(words[1:], order))
            else:
                raise ValueError
        except (KeyError, IndexError, ValueError, TypeError) as error:
            raise InputError(path, f"header, line {number}", f"{line!r} is no part of PLY", AGAIN) from error
    if not order:
        raise InputError(path, "header", "does not say whether the file is text or binary", AGAIN)
    return elements, text, last.end()


def _count(word: str) -> int:
    if not word.isdigit():
        raise ValueError
    return int(word)


def _property(words: list[str], order: str) -> Property:
    if words[0] == "list":
        length, values, name = words[1:4]
        return Property(name, np.dtype(order + TYPES[values]), np.dtype(order + TYPES[length]))
    return Property(words[1], np.dtype(order + TYPES[words[0]]))


def _body(path: str | Path, elements: list[Element], raw: Bytes, text: bool) -> tuple[Array, Polygons]:
    """The vertices and polygons among the elements' rows."""
    vertices, polygons = np.zeros((0, 3)), Polygons(np.zeros(0, np.int64), np.zeros(0, np.int64))
    position = 0
    for element in elements:
        if not element.properties:
            continue
        _require_room(path, element, len(raw) - position, text)
        offsets, lengths, position = _places(path, element, raw, position, text)
        columns = {p.name: (p, offsets[:, i], lengths[:, i]) for i, p in enumerate(element.properties)}
        if element.name == "vertex":
            if not {"x", "y", "z"} <= columns.keys():
                raise InputError(path, "vertex", "has no x, y and z", AGAIN)
            vertices = np.stack([_values(raw, *columns[axis]) for axis in "xyz"], axis=1)
        if element.name == "face":
            name = next((n for n in INDICES if n in columns), None)
            if name is None or columns[name][0].length is None:
                problem = f"has no list vertex_indices, but {', '.join(columns) or 'nothing'}"
                raise InputError(path, "face", problem, AGAIN)
            polygons = Polygons(_indices(path, _values(raw, *columns[name])), columns[name][2])
    if position < len(raw):
        spare = len(raw) - position
        log.warning(
            "%s: %d %s after the last face", path, *((spare // 8, "numbers") if text else (spare, "bytes"))
        )
    return vertices, polygons


def _require_room(path: str | Path, element: Element, left: int, text: bool) -> None:
    if element.count * element.least > left:
        unit, size = ("numbers", 8) if text else ("bytes", 1)
        problem = f"{element.count} are declared, at least {element.count * element.least // size} {unit}, "
        problem += f"but {left // size} follow"
        raise InputError(
            path, f"element {element.name}", problem, "The file is cut off or damaged: copy it again"
        )


def _places(
    path: str | Path, element: Element, raw: Bytes, start: int, text: bool
) -> tuple[IntArray, IntArray, int]:
    """Where each row's values begin (count, properties), how many there are, and where the element ends."""
    columns = element.properties
    if all(p.length is None for p in columns):
        sizes = np.array([p.values.itemsize for p in columns], dtype=np.int64)
        rows = start + element.least * np.arange(element.count)
        offsets = rows[:, None] + (np.cumsum(sizes) - sizes)
        return offsets, np.ones_like(offsets), start + element.least * element.count
    kinds = np.array([[p.values.itemsize, 0 if p.length is None else p.length.itemsize] for p in columns])
    big = any(p.length is not None and p.length.byteorder == ">" for p in columns)
    offsets, lengths, end = _walk(
        raw, raw.view("<f8") if text else np.zeros(0), start, element.count, kinds, big
    )
    if end < 0:
        problem = f"the list of row {-end - 1} is longer than the file"
        raise InputError(
            path, f"element {element.name}", problem, "The file is cut off or damaged: copy it again"
        )
    return offsets, lengths, end


@njit(cache=True)
def _walk(raw, numbers, start, count, kinds, big):  # type: ignore[no-untyped-def]
    """Offsets and lengths (count, properties) and the end; kinds: bytes of a value and of a length (0: none).

    The end is -1 - row where a row does not fit.
    """
    columns = len(kinds)
    offsets, lengths = np.empty((count, columns), np.int64), np.ones((count, columns), np.int64)
    at = start
    for row in range(count):
        for i in range(columns):
            size = kinds[i, 1]
            if size > 0:
                if at + size > len(raw):
                    return offsets, lengths, -1 - row
                length = 0
                if len(numbers) > 0:
                    number = numbers[at // 8]
                    if not 0 <= number <= len(raw) or number != int(number):
                        return offsets, lengths, -1 - row
                    length = int(number)
                else:
                    for k in range(size):
                        length = length * 256 + raw[at + k if big else at + size - 1 - k]
                lengths[row, i] = length
                at += size
            offsets[row, i] = at
            at += lengths[row, i] * kinds[i, 0]
            if at > len(raw):
                return offsets, lengths, -1 - row
    return offsets, lengths, at


def _values(raw: Bytes, column: Property, offsets: IntArray, lengths: IntArray) -> Array:
    """All values of a column, row after row."""
    size = column.values.itemsize
    within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    places = np.repeat(offsets, lengths) + size * within
    found = np.ascontiguousarray(raw[places[:, None] + np.arange(size)]).view(column.values)
    return found.reshape(-1).astype(np.float64)


def _indices(path: str | Path, values: Array) -> IntArray:
    if not (np.isfinite(values).all() and (values == np.round(values)).all()):
        raise InputError(path, "face", "has indices that are no whole numbers", AGAIN)
    return values.astype(np.int64)
