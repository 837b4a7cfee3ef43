"""The triangles of an STL file, text or binary, with equal corners made one vertex."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError
from handpipe.mesh.files.polygons import Polygons

log = logging.getLogger(__name__)

HEADER, RECORD = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
CUT_OFF = "The file is cut off or damaged: copy it again"


def read_stl(path: str | Path) -> tuple[Array, Polygons]:
    """The vertices and triangles of an STL file.

    A file is binary if its size is what the count of a binary file says, whatever its header's text.

    Parameters
    ----------
    path : path
        File to read.

    Returns
    -------
    vertices : array (n, 3)
        Positions in the file's unit, each once, sorted by coordinates.
    polygons : Polygons
        Triangles in the file's order.

    Raises
    ------
    InputError
        Where the file is malformed.
    """
    content = Path(path).read_bytes()
    size = HEADER + RECORD.itemsize * int.from_bytes(content[80:84], "little")
    if len(content) >= HEADER and len(content) == size:
        corners = _binary(content)
    elif content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:100_000].lower():
        corners = _text(path, content)
    elif len(content) > size and len(content) >= HEADER:
        log.warning("%s: %d bytes after the last triangle", path, len(content) - size)
        corners = _binary(content[:size])
    else:
        problem = f"has {len(content)} bytes; a binary STL file with its count of triangles has {size}"
        raise InputError(path, "content", problem, CUT_OFF)
    vertices, inverse = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    return vertices, Polygons(inverse.reshape(-1), np.full(len(corners), 3))


def _binary(content: bytes) -> Array:
    return np.frombuffer(content, dtype=RECORD, offset=HEADER)["corners"].astype(np.float64)


def _text(path: str | Path, content: bytes) -> Array:
    facets = len(re.findall(rb"\bendfacet\b", content, re.IGNORECASE))
    begun = len(re.findall(rb"\bfacet\b", content, re.IGNORECASE))
    words = re.findall(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", content, re.IGNORECASE)
    if len(words) != 3 * facets or begun != facets or not re.search(rb"\bendsolid\b", content, re.IGNORECASE):
        problem = f"{begun} facets begin, {facets} end, with {len(words)} vertices"
        raise InputError(path, "facet", problem, CUT_OFF)
    try:
        return np.array(words, dtype=np.float64).reshape(-1, 3, 3)
    except ValueError as error:
        raise InputError(path, "vertex", f"is not three numbers ({error})", CUT_OFF) from error
