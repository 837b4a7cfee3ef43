"""Surfaces from files of other programs, checked and closed as far as that is safe, and to files."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np

from handpipe.core import Array, InputError, IntArray, atomic
from handpipe.mesh.files.obj import read_obj
from handpipe.mesh.files.ply import read_ply
from handpipe.mesh.files.polygons import NotSimple, Polygons, triangulate
from handpipe.mesh.files.stl import read_stl
from handpipe.mesh.surfaces import Surface, component_labels, place_in_words, require_closed

log = logging.getLogger(__name__)

READERS: dict[str, Callable[[Path], tuple[Array, Polygons]]] = {
    ".ply": read_ply,
    ".obj": read_obj,
    ".stl": read_stl,
}
SURFACE_SUFFIXES = tuple(READERS)  # of files that `read_surface` reads
METRES, MICROMETRES = 1.0, 3000.0  # mm; no part of a hand is smaller or larger


def read_surface(path: str | Path, *, closed: bool = False) -> Surface:
    """Read a surface from a PLY, OBJ or STL file.

    Polygons are cut into triangles. Several vertices at one place, as along seams of texture, count as one
    where that closes gaps: triangles name the first of them. Triangles that name a vertex twice are left out.
    The log says each of these changes.

    Parameters
    ----------
    path : path
        File in mm; its suffix tells the format.
    closed : bool
        Whether the surface must be closed; each of its parts is then turned to face outwards.

    Returns
    -------
    Surface
        Vertices in mm, in the file's order; those of STL, which repeats them, are merged and sorted.

    Raises
    ------
    InputError
        Where the file is missing or malformed, has no triangles, has NaN coordinates, or looks like metres or
        micrometres; with `closed`, where the surface is open.
    """
    path = Path(path)
    vertices, polygons = _read(path)
    surface = _triangles(path, vertices, polygons)
    if len(surface.boundary_edges()):
        surface = _welded(path, surface)
    _check_size(path, surface)
    if closed:
        require_closed(surface, path)
        return _outwards(path, surface)
    return surface


def _read(path: Path) -> tuple[Array, Polygons]:
    if not path.exists():
        raise InputError(path, "file", "does not exist", "Check the path")
    if path.suffix.lower() not in READERS or not path.is_file():
        raise InputError(path, "file", "is not PLY, OBJ or STL", "Convert it to one of these")
    if path.stat().st_size == 0:
        raise InputError(path, "file", "is empty", "Export the surface again")
    try:
        return READERS[path.suffix.lower()](path)
    except OSError as error:
        raise InputError(path, "file", f"cannot be read ({error})", "Check its permissions") from error


def _triangles(path: Path, vertices: Array, polygons: Polygons) -> Surface:
    """The polygons cut into triangles, without those that name a vertex twice."""
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        problem = f"NaN or infinite coordinates in {len(bad)} vertices, the first is vertex {bad[0]}"
        raise InputError(path, "vertices", problem, "Remove these vertices or export the surface again")
    if (polygons.counts < 3).all():
        raise InputError(path, "triangles", "there are none", "Export a triangle surface, not points")
    corners = polygons.corners
    wrong = np.flatnonzero((corners < 0) | (corners >= len(vertices)))
    if len(wrong):
        face = int(np.searchsorted(np.cumsum(polygons.counts), wrong[0], side="right"))
        problem = f"face {face} names vertex {corners[wrong[0]]}, but there are {len(vertices)} vertices"
        raise InputError(path, "triangles", problem, "Export the surface again")
    try:
        triangles = triangulate(vertices, polygons)
    except NotSimple as error:
        place = place_in_words(vertices[corners[polygons.starts[error.number]]])
        problem = f"face {error.number} near {place} crosses itself"
        raise InputError(path, "triangles", problem, "Export the surface as triangles") from error
    larger = np.count_nonzero(polygons.counts > 3)
    if larger:
        log.info("%s: cut %d polygons of more than three corners into triangles", path, larger)
    repeated = (triangles == np.roll(triangles, 1, axis=1)).any(axis=1)
    if repeated.all():
        raise InputError(path, "triangles", "each names a vertex twice", "Export the surface again")
    if repeated.any():
        log.warning("%s: left out %d triangles that name a vertex twice", path, repeated.sum())
    return Surface(vertices, triangles[~repeated])


def _welded(path: Path, surface: Surface) -> Surface:
    """The surface with triangles joined where vertices are at the same place; vertices keep their numbers."""
    used = np.unique(surface.triangles)
    _, first, inverse = np.unique(
        surface.vertices[used] + 0.0, axis=0, return_index=True, return_inverse=True
    )
    renamed = np.arange(len(surface.vertices))
    renamed[used] = used[first[inverse.reshape(-1)]]
    triangles = renamed[surface.triangles]
    triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
    found = Surface(surface.vertices, triangles)
    if len(found.boundary_edges()) == len(surface.boundary_edges()) or len(triangles) == 0:
        return surface
    log.info("%s: %d vertices are at the place of others: joined", path, len(used) - len(first))
    return found


def _check_size(path: Path, surface: Surface) -> None:
    extent = float(np.ptp(surface.vertices[surface.triangles].reshape(-1, 3), axis=0).max())
    for unit, wrong, factor in (
        ("metres", extent < METRES, "1000"),
        ("micrometres", extent > MICROMETRES, "0.001"),
    ):
        if wrong:
            problem = f"looks like {unit} (extent {extent:.3g})"
            raise InputError(path, "units", problem, f"Give mm: scale by {factor}")


def _outwards(path: Path, surface: Surface) -> Surface:
    """A closed surface whose parts face outwards, but inwards within an odd number of others: cavities."""
    labels = component_labels(surface.triangles)
    parts = [Surface(surface.vertices, surface.triangles[labels == i]) for i in range(labels.max() + 1)]
    parts = [part if part.volume() > 0 else part.flipped() for part in parts]
    triangles = surface.triangles.copy()
    turned = 0
    for i, part in enumerate(parts):
        point = part.vertices[part.triangles[:1, 0]]
        depth = sum(bool(other.contains(point)[0]) for j, other in enumerate(parts) if j != i)
        right = part.triangles if depth % 2 == 0 else part.triangles[:, ::-1]
        turned += not np.array_equal(_cyclic(right), _cyclic(triangles[labels == i]))
        triangles[labels == i] = right
    if turned and len(parts) > 1:
        log.warning("%s: turned %d of %d parts to face outwards", path, turned, len(parts))
    return Surface(surface.vertices, triangles)


def _cyclic(triangles: IntArray) -> IntArray:
    """The same triangles (k, 3), each from its smallest vertex on."""
    start = np.argmin(triangles, axis=1)[:, None]
    return np.take_along_axis(triangles, (start + np.arange(3)) % 3, axis=1)


def write_surface(path: str | Path, surface: Surface) -> None:
    """Write a surface atomically, with coordinates in mm.

    Parameters
    ----------
    path : path
        File to write; its suffix, .ply, .obj or .stl, tells the format.
    surface : Surface
        Surface to write.
    """
    mesh = meshio.Mesh(surface.vertices, [("triangle", surface.triangles.astype(np.int32))])
    with atomic(path) as temporary:
        if Path(path).suffix.lower() == ".obj":
            meshio.write(temporary, mesh)
        else:
            meshio.write(temporary, mesh, binary=True)
