"""The polygons of a Wavefront OBJ file.

A corner is its vertex alone, so that seams of texture or normals split nothing; groups, objects
and materials are one surface. meshio 5.3 refuses normals by corner; trimesh 5.2 cuts concave polygons
wrongly.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError
from handpipe.mesh.files.polygons import Polygons

AGAIN = "Export the surface again"


def read_obj(path: str | Path) -> tuple[Array, Polygons]:
    """The vertices and polygons of an OBJ file.

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
        Where the file is malformed; it names the first wrong line or kind of line.
    """
    text = Path(path).read_text(encoding="utf-8-sig", errors="replace").replace("\\\n", " ")
    points, faces, lines, seen = list[list[str]](), list[list[str]](), list[int](), list[int]()
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if words and words[0] == "v":
            points.append(words[1:4])
            if len(words) < 4:
                raise _bad(path, number, line)
        elif words and words[0] == "f":
            faces.append([word.partition("/")[0] for word in words[1:]])
            lines.append(number)
            seen.append(len(points))
    try:
        vertices = np.array(points, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise InputError(path, "v", f"is not three numbers ({error})", AGAIN) from error
    try:
        corners = np.array([word for face in faces for word in face], dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise InputError(path, "f", f"has corners that are no vertex numbers ({error})", AGAIN) from error
    counts = np.array([len(face) for face in faces], dtype=np.int64)
    corners = np.where(corners < 0, corners + np.repeat(np.array(seen, dtype=np.int64), counts), corners - 1)
    wrong = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
    if len(wrong):
        place = lines[int(np.searchsorted(np.cumsum(counts), wrong[0], side="right"))]
        problem = f"names a vertex that does not exist; there are {len(vertices)}"
        raise InputError(path, f"line {place}", problem, AGAIN)
    return vertices, Polygons(corners, counts)


def _bad(path: str | Path, number: int, line: str) -> InputError:
    return InputError(path, f"line {number}", f"{line[:60]!r} is not three numbers", AGAIN)
