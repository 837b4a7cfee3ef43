"""Repair of surfaces: from the export of an editor or a scanner to a closed surface that faces outwards."""

from __future__ import annotations

import igl
import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.mesh.contact import cuts_itself
from handpipe.mesh.generation.implicit import Grid, isosurface
from handpipe.mesh.generation.remeshing import remesh, remesh_free
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface, concatenate, directed_edges
from handpipe.mesh.tets.operators import cotangent_laplacian, mass_lumped

MERGE = 1e-6  # of the extent: vertices closer than this are one
SMALL = 0.01  # of the largest part's area: smaller parts are dropped
FINEST = 150  # cells of a grid along the longest side


def repair(surface: Surface) -> tuple[Surface, list[str]]:
    """A closed surface that faces outwards, and what was changed.

    Merges duplicate vertices, drops triangles without area and small loose parts, orients triangles alike,
    fills holes with smooth patches, and rebuilds a surface that cuts itself from its winding number.

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


def fill_holes(surface: Surface, said: list[str]) -> Surface:
    """Close every hole by a patch that continues the surface smoothly at its rim; nothing else changes."""
    directed = directed_edges(surface.triangles)
    n = len(surface.vertices)
    forth, back = directed @ [n, 1], directed @ [1, n]
    rim = directed[~np.isin(forth, back)]
    if len(rim) == 0:
        return surface
    graph = coo_matrix((np.ones(len(rim)), rim.T), shape=(n, n))
    hole = np.unique(connected_components(graph, directed=False)[1][rim[:, 0]], return_inverse=True)[1]
    count = hole.max() + 1
    middle = np.zeros((count, 3))
    np.add.at(middle, hole, surface.vertices[rim[:, 0]])
    middle /= np.bincount(hole)[:, None]
    fans = np.stack([rim[:, 1], rim[:, 0], n + hole], axis=1)
    filled = Surface(np.concatenate([surface.vertices, middle]), np.concatenate([surface.triangles, fans]))
    said.append(f"Filled {count} hole{'s' if count > 1 else ''} of {len(rim)} edges in all.")
    if not filled.is_closed():
        return filled
    rim_length = float(np.linalg.norm(np.diff(surface.vertices[rim], axis=1), axis=2).mean())
    fixed = np.arange(len(filled.vertices)) < n
    for _ in range(3):
        filled = remesh_free(filled, rim_length, fixed, _stay)
        fixed = np.arange(len(filled.vertices)) < n
        filled = _fair(filled, fixed)
    return filled


def _stay(points: Array) -> Array:
    return points


def _fair(surface: Surface, fixed: BoolArray) -> Surface:
    """Move free vertices to the least biharmonic energy: the patch continues the slope at its rim."""
    stiffness = cotangent_laplacian(surface.vertices, surface.triangles)
    area = mass_lumped(surface.vertices, surface.triangles)
    energy = (stiffness @ diags(1 / np.maximum(area, 1e-12)) @ stiffness).tocsr()
    free = ~fixed
    vertices = surface.vertices.copy()
    if free.any():
        right = -energy[free][:, fixed] @ vertices[fixed]
        vertices[free] = spsolve(energy[free][:, free].tocsc(), right).reshape(-1, 3)
    return surface.moved(vertices)


def _rebuild(surface: Surface, said: list[str]) -> Surface:
    """The outer surface of all points that the surface winds around."""
    length = max(float(surface.edge_lengths().mean()), float(np.ptp(surface.vertices, axis=0).max()) / FINEST)
    grid = Grid.around(surface.vertices, 2 * length, length)
    points = grid.points()
    distance = Distance(surface).closest(points)[0]
    said.append(f"Rebuilt the surface, which cut itself or was not a manifold, on a grid of {length:.2g} mm.")
    return remesh(isosurface(np.where(surface.contains(points), -distance, distance), grid), length)
