"""Self-contact of a closed surface: its vertices, and the places of its other sheets that they meet."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
import trimesh
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces.barycentric import barycentric_matrix
from handpipe.mesh.surfaces.surface import Surface

FACING = -0.25  # largest cosine between the normals of two sheets in contact
LIFT = 1e-2  # mm off its own sheet, where the winding number of a vertex is computed


@dataclass(frozen=True)
class SelfContact:
    """Contacts between vertices of a surface and other sheets of it.

    Parameters
    ----------
    vertices : array (c,) of int
        Vertices in contact, sorted, each once.
    feet : sparse matrix (c, n)
        Weights of the surface's vertices that make up the place that each vertex meets.
    normals : array (c, 3)
        Unit normals at these places, outwards.
    gaps : array (c,)
        Gaps along the normals in mm, negative where the vertex is beneath its place.
    """

    vertices: IntArray
    feet: sparse.csr_matrix
    normals: Array
    gaps: Array


def self_contact(surface: Surface, rest: Surface, near: float, deep: float) -> SelfContact:
    """The vertices that are near another sheet of the surface or beneath one, each with its closest place.

    Another sheet faces the vertex and is no part of its neighbourhood: at rest it was more than three edge
    lengths away. The winding number tells whether a vertex is beneath a sheet: across a thin web the other
    side is near, too, but not above the vertex.

    Parameters
    ----------
    surface : Surface
        Closed surface in its present shape, in mm.
    rest : Surface
        The same surface at rest.
    near : float
        Largest distance in mm from a vertex to the sheet in front of it.
    deep : float
        Largest depth in mm of a vertex beneath a sheet.

    Returns
    -------
    SelfContact
    """
    normals = surface.vertex_normals()
    beneath = surface.contains(surface.vertices + LIFT * normals)
    reach = np.where(beneath, deep, near)
    vertices, triangles = _candidates(surface, rest, reach, normals)
    corners = surface.vertices[surface.triangles[triangles]]
    places = trimesh.triangles.closest_point(corners, surface.vertices[vertices])
    offsets = surface.vertices[vertices] - places
    distances = np.linalg.norm(offsets, axis=1)
    above = np.einsum("ni,ni->n", offsets, surface.triangle_normals()[triangles]) > 0
    known = (distances < reach[vertices]) & (above != beneath[vertices])
    kept = np.flatnonzero(known)
    order = kept[np.lexsort((distances[kept], vertices[kept]))]
    first = order[np.unique(vertices[order], return_index=True)[1]]
    return _at(surface, vertices[first], triangles[first], places[first])


def _candidates(surface: Surface, rest: Surface, reach: Array, normals: Array) -> tuple[IntArray, IntArray]:
    """Pairs of vertices (p,) and triangles (p,) that may be in contact within each vertex's reach (n,)."""
    corners = surface.vertices[surface.triangles]
    centres = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centres[:, None], axis=2).max()
    asked = np.flatnonzero(reach > 0)
    found = cKDTree(centres).query_ball_point(
        surface.vertices[asked], reach[asked] + radius, return_sorted=False
    )
    counts = np.fromiter(map(len, found), dtype=np.int64, count=len(found))
    vertices = np.repeat(asked, counts)
    triangles = np.fromiter(chain.from_iterable(found), dtype=np.int64, count=len(vertices))
    facing = np.einsum("ni,ni->n", normals[vertices], surface.triangle_normals()[triangles]) < FACING
    away = rest.vertices[vertices] - rest.vertices[rest.triangles].mean(axis=1)[triangles]
    chosen = facing & (np.linalg.norm(away, axis=1) > 3 * rest.edge_lengths().mean())
    vertices, triangles = vertices[chosen], triangles[chosen]
    order = np.lexsort((triangles, vertices))
    return vertices[order], triangles[order]


def _at(surface: Surface, vertices: IntArray, triangles: IntArray, places: Array) -> SelfContact:
    feet = barycentric_matrix(places, surface.triangles[triangles], surface.vertices)
    normals = surface.smooth_normals(feet)
    gaps = np.einsum("ni,ni->n", surface.vertices[vertices] - places, normals)
    return SelfContact(vertices, feet, normals, gaps)
