"""Repair of surfaces: from the export of an editor or a scanner to a closed surface that faces outwards."""

from __future__ import annotations

import igl
import numpy as np

from handpipe.core import BoolArray, InputError, IntArray
from handpipe.mesh.contact import crossings, cuts_itself
from handpipe.mesh.generation.hole_filling import fill_holes, rings_around
from handpipe.mesh.generation.implicit import Grid, isosurface
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface, concatenate

MERGE = 1e-6  # of the extent: vertices closer than this are one
SMALL = 0.01  # of the largest part's area: smaller parts are dropped
FINEST = 150  # cells of a grid along the longest side
RINGS = (0, 1, 2, 3, 4)  # of triangles around a fault that are cut out, one width after the other


def repair(surface: Surface) -> tuple[Surface, list[str]]:
    """A closed surface that faces outwards, and what was changed.

    Merges duplicate vertices, drops triangles without area and small loose parts, orients triangles alike,
    fills holes with smooth patches, and what cuts itself as well. A surface that still cuts itself is rebuilt
    from its winding number.

    Parameters
    ----------
    surface : Surface
        Surface in mm, as an editor or a scanner exported it.

    Returns
    -------
    repaired : Surface
        Closed surface; its vertices are renumbered.
    changes : list of str
        A sentence for each kind of change.

    Raises
    ------
    InputError
        Where the result is still open.
    """
    said: list[str] = []
    surface = _merge_vertices(surface, said)
    surface = _drop_degenerate(surface, said)
    surface = _drop_small_parts(surface, said)
    surface = _orient(surface, said)
    surface = fill_holes(surface, said)
    if not surface.is_closed() or cuts_itself(surface):
        surface = _without_faults(surface, said)
    if not surface.is_closed() or cuts_itself(surface):
        surface = _rebuild(surface, said)
    if not surface.is_closed():
        raise InputError("repair", "surface", "is still open after repair", "Mend it in a mesh editor")
    return surface, said


def _merge_vertices(surface: Surface, said: list[str]) -> Surface:
    surface = surface.compact()
    tolerance = MERGE * np.ptp(surface.vertices, axis=0).max()
    vertices, _, inverse, triangles = igl.remove_duplicate_vertices(
        surface.vertices, surface.triangles, tolerance
    )
    if len(vertices) < len(surface.vertices):
        said.append(f"Merged {len(surface.vertices) - len(vertices)} duplicate vertices.")
        surface = Surface(vertices, triangles)
    return surface


def _drop_degenerate(surface: Surface, said: list[str]) -> Surface:
    t = surface.triangles
    flat = (t[:, 0] == t[:, 1]) | (t[:, 1] == t[:, 2]) | (t[:, 2] == t[:, 0])
    _, first = np.unique(np.sort(t, axis=1), axis=0, return_index=True)
    doubled = np.ones(len(t), dtype=bool)
    doubled[first] = False
    if (bad := flat | doubled).any():
        said.append(f"Dropped {bad.sum()} triangles that had no area or were there twice.")
    return Surface(surface.vertices, t[~bad])


def _drop_small_parts(surface: Surface, said: list[str]) -> Surface:
    parts = surface.components()
    kept = [part for part in parts if part.area() >= SMALL * parts[0].area()]
    if len(kept) < len(parts):
        said.append(f"Dropped {len(parts) - len(kept)} small loose parts.")
    return concatenate(kept)


def _orient(surface: Surface, said: list[str]) -> Surface:
    """Orient neighbours alike, then each part outwards (an open part by the sign of its volume)."""
    alike, parts = igl.bfs_orient(surface.triangles)
    triangles = np.asarray(alike, dtype=np.int64)
    parts = np.asarray(parts).reshape(-1)
    for part in np.unique(parts):
        if Surface(surface.vertices, triangles[parts == part]).compact().volume() < 0:
            triangles[parts == part] = triangles[parts == part][:, ::-1]
    changed = _winding(surface.triangles) != _winding(triangles)
    if changed.any():
        said.append(f"Turned {changed.sum()} triangles to face outwards.")
    return Surface(surface.vertices, triangles)


def _winding(triangles: IntArray) -> BoolArray:
    """Whether each triangle runs through its sorted corners forwards (k,)."""
    lowest = np.argmin(triangles, axis=1)[:, None]
    first, second = (np.take_along_axis(triangles, (lowest + i) % 3, axis=1)[:, 0] for i in (1, 2))
    return first < second


def _without_faults(surface: Surface, said: list[str]) -> Surface:
    """Cut out and fill what crosses or is no manifold, unless a patch would be far off.

    Patches may cut what is beside them: then more around them is cut out.
    """
    found, area = surface, 0.0
    for rings in RINGS:
        gone = rings_around(_faults(found), found.triangles, rings)
        if gone.all():
            break
        area += float(found.triangle_areas()[gone].sum())
        peeled = Surface(found.vertices, found.triangles[~gone])
        found = fill_holes(_drop_small_parts(peeled, []), [])
        if not found.is_closed() or cuts_itself(found):
            continue
        if Distance(found).closest(surface.vertices)[0].max() > _cell(surface):
            break
        said.append(f"Filled {area:.2g} mm^2 anew, where the surface cut itself or was not a manifold.")
        return found
    return surface


def _cell(surface: Surface) -> float:
    """Cell in mm of the grid on which a surface is rebuilt: a patch is at most as far off."""
    return max(float(surface.edge_lengths().mean()), float(np.ptp(surface.vertices, axis=0).max()) / FINEST)


def _faults(surface: Surface) -> BoolArray:
    """Vertices (n,) of edges and triangles that cross, and of edges without exactly two triangles."""
    pairs = crossings(surface)
    found = np.zeros(len(surface.vertices), dtype=bool)
    found[surface.edges()[pairs[:, 0]]] = True
    found[surface.triangles[pairs[:, 1]]] = True
    found[surface.crowded_edges()] = True
    found[surface.boundary_edges()] = True
    return found


def _rebuild(surface: Surface, said: list[str]) -> Surface:
    """The outer surface of all points that the surface winds around."""
    length = _cell(surface)
    grid = Grid.around(surface.vertices, 2 * length, length)
    points = grid.points()
    distance = Distance(surface).closest(points)[0]
    said.append(f"Rebuilt the surface, which cut itself or was not a manifold, on a grid of {length:.2g} mm.")
    return remesh(isosurface(np.where(surface.contains(points), -distance, distance), grid), length)
