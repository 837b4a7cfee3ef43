"""Filling of holes with smooth patches."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import spsolve

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.generation.remeshing import remesh_free, split_fans
from handpipe.mesh.surfaces.surface import Surface, directed_edges, sums_at
from handpipe.mesh.tets.operators import cotangent_laplacian, mass_lumped

AROUND = 4  # rings of triangles around a hole that take part: the smoothness of its patch asks for two


def fill_holes(surface: Surface, said: list[str]) -> Surface:
    """Close every hole by a patch that continues the surface smoothly at its rim; nothing else changes."""
    rim = _rim(surface.triangles)
    if len(rim) == 0:
        return surface
    filled = _with_fans(surface, rim)
    n = len(surface.vertices)
    count = len(filled.vertices) - n
    said.append(f"Filled {count} hole{'s' if count > 1 else ''} of {len(rim)} edges in all.")
    if not filled.is_closed():
        return filled
    length = float(np.linalg.norm(np.diff(surface.vertices[rim], axis=1), axis=2).mean())
    near = rings_around(np.arange(len(filled.vertices)) >= n, filled.triangles, AROUND)
    return _patched(filled, n, near, length)


def rings_around(vertices: BoolArray, triangles: IntArray, rings: int) -> BoolArray:
    """Which triangles (k,) touch the vertices (n,), or lie in one of the rings around those.

    More are added where they would meet in a vertex alone: each vertex of their rim has two neighbours there.
    """
    near = vertices.copy()
    for _ in range(rings):
        near[triangles[near[triangles].any(axis=1)]] = True
    while True:
        chosen = np.asarray(near[triangles].any(axis=1))
        starts, counts = np.unique(_rim(triangles[chosen])[:, 0], return_counts=True)
        pinched = starts[(counts > 1) & ~near[starts]]
        if len(pinched) == 0:
            return chosen
        near[pinched] = True


def _rim(triangles: IntArray) -> IntArray:
    """Directed edges (r, 2) of triangles that no other triangle has the other way."""
    directed = directed_edges(triangles)
    n = int(triangles.max(initial=0)) + 1
    return directed[~np.isin(directed @ [n, 1], directed @ [1, n])]


def _with_fans(surface: Surface, rim: IntArray) -> Surface:
    """A surface whose every hole is closed by a fan around a new vertex, the middle of its rim."""
    n = len(surface.vertices)
    graph = coo_matrix((np.ones(len(rim)), rim.T), shape=(n, n))
    hole = np.unique(connected_components(graph, directed=False)[1][rim[:, 0]], return_inverse=True)[1]
    middle = sums_at(hole, surface.vertices[rim[:, 0]], hole.max() + 1) / np.bincount(hole)[:, None]
    fans = np.stack([rim[:, 1], rim[:, 0], n + hole], axis=1)
    return Surface(np.concatenate([surface.vertices, middle]), np.concatenate([surface.triangles, fans]))


def _patched(filled: Surface, n: int, near: BoolArray, length: float) -> Surface:
    """Fans around all vertices from `n` on turned into smooth patches, with edges of about a length in mm.

    Only the triangles `near` (k,) are looked at, with fans that close them.
    """
    part = Surface(filled.vertices, filled.triangles[near])
    if len(rim := _rim(part.triangles)):
        part = _with_fans(part, rim)
    part, source = split_fans(part)
    fixed = (source < n) | (source >= len(filled.vertices))
    names = np.where(source < n, source, -1)[fixed]
    for _ in range(3):
        part = remesh_free(part, length, fixed, _stay)
        fixed = np.arange(len(part.vertices)) < len(names)
        part = _fair(part, fixed)
    new = part.vertices[len(names) :]
    patch = np.concatenate([names, n + np.arange(len(new))])[part.triangles]
    triangles = np.concatenate([filled.triangles[~near], patch[(patch >= 0).all(axis=1)]])
    return Surface(np.concatenate([filled.vertices[:n], new]), triangles)


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
