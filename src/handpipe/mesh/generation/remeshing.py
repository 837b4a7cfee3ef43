"""Isotropic remeshing of closed surfaces (Botsch and Kobbelt 2004): split, collapse, flip, relax, project."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.generation import halfedges
from handpipe.mesh.surfaces.distance import Distance
from handpipe.mesh.surfaces.surface import Surface, require_closed

Project = Callable[[Array], Array]  # points (n, 3) -> points (n, 3) on the surface that is kept


def remesh(surface: Surface, edge_length: float, *, iterations: int = 10) -> Surface:
    """The same closed surface with triangles of about one edge length.

    Sharp edges are not kept.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm.
    edge_length : float
        Edge length in mm.
    iterations : int
        Rounds of splitting, collapsing, flipping and relaxing; halving the longest edge takes further rounds.

    Returns
    -------
    Surface
        Its vertices lie on the input surface.

    Raises
    ------
    InputError
        Where the surface is open.
    """
    distance = Distance(surface)
    free = np.zeros(len(surface.vertices), dtype=bool)
    return remesh_free(
        surface, edge_length, free, lambda points: distance.closest(points)[2], iterations=iterations
    )


def remesh_free(
    surface: Surface, edge_length: float, fixed: BoolArray, project: Project, *, iterations: int = 10
) -> Surface:
    """`remesh` that keeps some vertices and the edges between them, with any projection.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm.
    edge_length : float
        Edge length in mm.
    fixed : array (n,) of bool
        Which vertices stay where they are.
    project : function
        Takes points (k, 3) in mm to points (k, 3) on the surface that is kept.
    iterations : int
        As in `remesh`.

    Returns
    -------
    Surface
        Fixed vertices come first, in their order.

    Raises
    ------
    InputError
        Where the surface is open.
    """
    require_closed(surface, "remeshing")
    x, corner, twin, out, fixed_mask = _half_edges(surface, fixed)
    n_vertices, n_faces = len(fixed_mask), len(corner) // 3
    halvings = max(0, int(np.ceil(np.log2(surface.edge_lengths().max() / edge_length))))
    for _ in range(iterations + halvings):
        needed = _splits(x, corner, edge_length)
        x, out, fixed_mask = (_grown(array, n_vertices + needed) for array in (x, out, fixed_mask))
        corner, twin = (_grown(array, 3 * n_faces + 6 * needed) for array in (corner, twin))
        corner[3 * n_faces :] = -1
        edges = halfedges.HalfEdges(corner, twin, out)
        n_vertices, n_faces = halfedges.split_long(x, edges, fixed_mask, edge_length, n_vertices, n_faces)
        halfedges.collapse_short(x, edges, fixed_mask, edge_length, n_faces)
        for _ in range(5):
            if halfedges.flip_to_delaunay(x, edges, fixed_mask, n_faces) == 0:
                break
        x, corner, twin, out, fixed_mask = _squeezed(x, corner, twin, fixed_mask, n_vertices, n_faces)
        n_vertices, n_faces = len(x), len(corner) // 3
        x = _relaxed(x, corner.reshape(-1, 3), fixed_mask, project)
    edges = halfedges.HalfEdges(corner, twin, out)
    for _ in range(5):
        halfedges.flip_to_delaunay(x, edges, fixed_mask, n_faces)
        x = _relaxed(x, corner.reshape(-1, 3), fixed_mask, project)
    return Surface(x, corner.reshape(-1, 3))


def relax(surface: Surface, project: Project, iterations: int) -> Surface:
    """The same triangles with a better shape: vertices move along the surface and are projected back to it.

    Parameters
    ----------
    surface : Surface
        Surface in mm.
    project : function
        Takes points (k, 3) in mm to points (k, 3) on the surface that is kept.
    iterations : int
        Number of moves.

    Returns
    -------
    Surface
    """
    nothing = np.zeros(len(surface.vertices), dtype=bool)
    x = surface.vertices
    for _ in range(iterations):
        x = _relaxed(x, surface.triangles, nothing, project)
    return surface.moved(x)


def split_fans(surface: Surface) -> tuple[Surface, IntArray]:
    """A surface in which each vertex has one fan of triangles: others are doubled, unused ones left out.

    Parameters
    ----------
    surface : Surface
        Closed surface in mm.

    Returns
    -------
    split : Surface
        The same triangles, in their order.
    source : array (n,) of int
        Of each of its vertices the one of `surface` that it stands for.
    """
    corner, _, _, source = _with_twins(surface, np.zeros(len(surface.vertices), dtype=bool))
    return Surface(surface.vertices[source], corner.reshape(-1, 3)), source


def _half_edges(surface: Surface, fixed: BoolArray):  # type: ignore[no-untyped-def]
    """Half-edge arrays of the surface; fixed vertices first, a vertex between two fans doubled."""
    corner, twin, out, source = _with_twins(surface, fixed)
    return surface.vertices[source].copy(), corner, twin, out, fixed[source].copy()


def _with_twins(surface: Surface, fixed: BoolArray):  # type: ignore[no-untyped-def]
    """The arrays of `_half_edges`, but for places the vertices of the surface that they stand for."""
    order = np.concatenate([np.flatnonzero(fixed), np.flatnonzero(~fixed)])
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    triangles = rank[surface.triangles]
    twin, fan = halfedges.build(triangles)
    old = np.zeros(fan.max() + 1, dtype=np.int64)
    old[fan] = triangles.ravel()
    by_vertex = np.argsort(old, kind="stable")
    new = np.empty_like(by_vertex)
    new[by_vertex] = np.arange(len(by_vertex))
    corner = new[fan]
    out = np.empty(len(new), dtype=np.int64)
    out[corner] = np.arange(len(corner))
    return corner, twin, out, order[old[by_vertex]]


def _splits(x: Array, corner: IntArray, edge_length: float) -> int:
    """Upper bound of the edges that one sweep splits: long edges, and long edges that splitting creates."""
    ends = x[corner.reshape(-1, 3)]
    lengths = np.linalg.norm(np.roll(ends, -1, axis=1) - ends, axis=2)
    return 4 * int((lengths > halfedges.SPLIT * edge_length).sum())


def _grown(array: NDArray, size: int) -> NDArray:
    more = np.zeros((max(size - len(array), 0), *array.shape[1:]), dtype=array.dtype)
    return np.concatenate([array, more])


def _squeezed(x, corner, twin, fixed_mask, n_vertices, n_faces):  # type: ignore[no-untyped-def]
    """The half-edge arrays without removed triangles and vertices, in the same order."""
    alive = corner[: 3 * n_faces] >= 0
    place = np.cumsum(alive) - 1
    corner, twin = corner[: 3 * n_faces][alive], place[twin[: 3 * n_faces][alive]]
    used, corner = np.unique(corner, return_inverse=True)
    corner = corner.reshape(-1)
    out = np.empty(len(used), dtype=np.int64)
    out[corner] = np.arange(len(corner))
    return x[used], corner, twin, out, fixed_mask[used]


def _relaxed(x: Array, triangles: IntArray, fixed_mask: BoolArray, project: Project) -> Array:
    moved = _tangential(x, triangles)
    moved[fixed_mask] = x[fixed_mask]
    free = ~fixed_mask
    moved[free] = project(moved[free])
    return moved


@njit(cache=True)
def _tangential(x, triangles):  # type: ignore[no-untyped-def]
    """Each vertex moved, within its tangent plane, to the area-weighted mean of its triangles' centres."""
    centre, normal, weight = np.zeros_like(x), np.zeros_like(x), np.zeros(len(x))
    for f in range(len(triangles)):
        a, b, c = triangles[f]
        area_normal = np.cross(x[b] - x[a], x[c] - x[a])
        area = np.sqrt(area_normal @ area_normal)
        middle = (x[a] + x[b] + x[c]) / 3
        for v in (a, b, c):
            centre[v] += area * middle
            normal[v] += area_normal
            weight[v] += area
    out = x.copy()
    for v in range(len(x)):
        squared = normal[v] @ normal[v]
        if weight[v] > 0 and squared > 0:
            step = centre[v] / weight[v] - x[v]
            out[v] += step - (step @ normal[v]) / squared * normal[v]
    return out
