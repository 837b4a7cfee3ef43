"""Tetrahedral meshes of other programs."""

from __future__ import annotations

import contextlib
import io
import logging
import re
from pathlib import Path

import meshio
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from handpipe.core import InputError, IntArray
from handpipe.mesh.files import METRES, MICROMETRES
from handpipe.mesh.tets.operators import tet_neighbours, tet_pieces
from handpipe.mesh.tets.tetrahedra import FACES, TetMesh

log = logging.getLogger(__name__)

FLAT = ("vertex", "line", "triangle", "quad", "polygon")  # boundaries and labels, allowed beside tets
AGAIN = "Export the mesh again"
# Counts for which a reader would allocate memory; they are text even in binary files.
COUNTS = re.compile(
    rb"^(?:POINTS|CELLS|CELL_TYPES)[ \t]+(\d+)(?:[ \t]+(\d+))?"
    rb"|^\$(?:Nodes|Elements)\s+(\d+)(?:[ \t]+(\d+))?"
    rb"|^[ \t]*(?:Vertices|Tetrahedra|Triangles)\s+(\d+)"
    rb'|NumberOf(?:Points|Cells)="(\d+)"',
    re.MULTILINE,
)
PACKED = 1000  # largest plausible count for each byte of a compressed file


def read_tets(path: str | Path) -> TetMesh:
    """Read a tetrahedral mesh, without vertices that no tet uses.

    Several vertices at one place are merged, which the log says. If all tets are inverted, the order of their
    vertices is changed.

    Parameters
    ----------
    path : path
        File in mm: VTK, VTU, Gmsh, MEDIT or another format that meshio reads, by its suffix.

    Returns
    -------
    TetMesh
        Vertices in mm, in the file's order.

    Raises
    ------
    InputError
        Where the file is missing or malformed; where it has no tets, quadratic tets, or other solid elements;
        where tets are inverted, flat, or there twice, three share a face, or the mesh is in several parts, or
        in parts that hang together at a vertex or an edge alone;
        where it looks like metres or micrometres.
    """
    path = Path(path)
    mesh = _read(path)
    tets = _linear_tets(path, mesh)
    points = np.asarray(mesh.points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(path, "vertices", f"have the shape {points.shape}, not (n, 3)", AGAIN)
    if tets.min() < 0 or tets.max() >= len(points):
        problem = f"name vertices that do not exist; there are {len(points)}"
        raise InputError(path, "tets", problem, AGAIN)
    used, tets = np.unique(tets, return_inverse=True)
    found = _welded(path, TetMesh(points[used], tets.reshape(-1, 4)))
    _check_size(path, found)
    if (found.volumes() < 0).all():
        found = TetMesh(found.vertices, found.tets[:, [0, 2, 1, 3]])
    found = found.checked(path)
    _check_faces(path, found)
    _check_parts(path, found)
    return found


def _read(path: Path) -> meshio.Mesh:
    if not path.exists():
        raise InputError(path, "file", "does not exist", "Check the path")
    if not path.is_file() or path.stat().st_size == 0:
        raise InputError(path, "file", "is empty or no file", AGAIN)
    kinds = meshio.extension_to_filetypes
    if path.suffix.lower() not in kinds:
        raise InputError(path, "file", f"{path.suffix!r} is no format of meshes", "Give VTK, VTU or Gmsh")
    _require_room(path)
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # meshio prints its warnings
            return _first_that_reads(path, kinds[path.suffix.lower()])
    except (Exception, SystemExit) as error:  # meshio exits or raises anything on a malformed file
        said = str(error) or type(error).__name__
        raise InputError(path, "content", f"cannot be read ({said})", AGAIN) from error


def _first_that_reads(path: Path, kinds: list[str]) -> meshio.Mesh:
    for kind in kinds[:-1]:
        with contextlib.suppress(Exception, SystemExit):
            return meshio.read(path, file_format=kind)
    return meshio.read(path, file_format=kinds[-1])


def _require_room(path: Path) -> None:
    """Raise `InputError` where the file declares more than it can hold, before room is made for that."""
    content = path.read_bytes()
    most = len(content) * (PACKED if path.suffix.lower() == ".vtu" else 1)
    for match in COUNTS.finditer(content):
        largest = max(int(group) for group in match.groups() if group)
        if largest > most:
            declared = " ".join(match[0].decode("latin-1").split())
            problem = f"{declared} is declared, but the file has {len(content)} bytes"
            raise InputError(path, "content", problem, "The file is cut off or damaged: copy it again")


def _linear_tets(path: Path, mesh: meshio.Mesh) -> IntArray:
    counts: dict[str, int] = {}
    for block in mesh.cells:
        counts[block.type] = counts.get(block.type, 0) + len(block.data)
    counts = {kind: count for kind, count in counts.items() if count}
    solid = {kind: n for kind, n in counts.items() if kind != "tetra" and not kind.startswith(FLAT)}
    if solid:
        named = ", ".join(f"{n} of type {kind}" for kind, n in solid.items())
        remedy = (
            "Export linear tets" if all(k.startswith("tetra") for k in solid) else "Mesh it with tets alone"
        )
        raise InputError(path, "cells", f"there are {named}, not linear tets", remedy)
    if "tetra" not in counts:
        raise InputError(path, "tets", "there are none", "Fill the surface with tetrahedra first")
    if len(counts) > 1:
        beside = ", ".join(f"{n} of type {kind}" for kind, n in counts.items() if kind != "tetra")
        log.info("%s: cells beside the tets are not used: %s", path, beside)
    return np.concatenate([block.data for block in mesh.cells if block.type == "tetra"]).astype(np.int64)


def _welded(path: Path, mesh: TetMesh) -> TetMesh:
    """The mesh with vertices at one place merged; some formats give every tet its own vertices."""
    _, first, inverse = np.unique(mesh.vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    if len(first) == len(mesh.vertices):
        return mesh
    log.warning("%s: %d vertices are at the place of others: joined", path, len(mesh.vertices) - len(first))
    kept = np.sort(first)
    return TetMesh(mesh.vertices[kept], np.searchsorted(kept, first[inverse.reshape(-1)])[mesh.tets])


def _check_size(path: Path, mesh: TetMesh) -> None:
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    if extent < METRES:
        raise InputError(path, "units", f"looks like metres (extent {extent:.3g})", "Give mm: scale by 1000")
    if extent > MICROMETRES:
        problem = f"looks like micrometres (extent {extent:.3g})"
        raise InputError(path, "units", problem, "Give mm: scale by 0.001")


def _check_faces(path: Path, mesh: TetMesh) -> None:
    _, first, counts = np.unique(np.sort(mesh.tets, axis=1), axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        problem = f"{np.count_nonzero(counts > 1)} are there twice, the first is tet {first[counts > 1][0]}"
        raise InputError(path, "tets", problem, "Remove the second ones")
    faces = np.sort(mesh.tets[:, FACES].reshape(-1, 3), axis=1)
    _, first, counts = np.unique(faces, axis=0, return_index=True, return_counts=True)
    if (counts > 2).any():
        problem = f"{np.count_nonzero(counts > 2)} faces have three tets or more, the first is of tet "
        problem += f"{first[counts > 2][0] // 4}"
        raise InputError(path, "tets", problem, "Mesh the surface again")


def _check_parts(path: Path, mesh: TetMesh) -> None:
    n = len(mesh.vertices)
    rows, columns = np.repeat(mesh.tets[:, 0], 3), mesh.tets[:, 1:].ravel()
    _, labels = connected_components(coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(n, n)))
    _require_one(path, labels[mesh.tets[:, 0]], "vertex", "Give one part, or join them")
    pieces = tet_pieces(len(mesh.tets), tet_neighbours(mesh.tets))
    _require_one(path, pieces, "face", "They turn about vertices or edges: join them by faces")


def _require_one(path: Path, parts: IntArray, shared: str, remedy: str) -> None:
    """Raise `InputError` where tets, each with the number of its part, are in several."""
    sizes = np.sort(np.bincount(parts))[::-1]
    if len(sizes) > 1:
        named = ", ".join(map(str, sizes[:4]))
        problem = f"are in {len(sizes)} parts that share no {shared}, of {named} tets"
        raise InputError(path, "tets", problem, remedy)
