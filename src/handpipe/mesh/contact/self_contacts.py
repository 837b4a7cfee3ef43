"""Where a closed surface lies on itself: its vertices, and the places of its other sheets that they meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces.barycentric import barycentric_matrix
from handpipe.mesh.surfaces.surface import Surface

FACING = -0.25  # cosine between normals of two sheets that lie on one another, at most
LIFT = 1e-2  # mm off its own sheet, where a vertex is asked for others around it


@dataclass(frozen=True)
class SelfContact:
    """Contacts between vertices of a surface and other sheets of it.

    Attributes
    ----------
    vertices : (c,)
        Vertices in contact.
    feet : (c, v)
        Weights of the vertices that make up the place each meets.
    normals : (c, 3)
        Normals there, outwards.
    gaps : (c,)
        Gaps in mm, negative where the vertex is beneath that place.
    """

    vertices: IntArray
    feet: sparse.csr_matrix
    normals: Array
    gaps: Array


def self_contact(surface: Surface, rest: Surface, near: float, deep: float) -> SelfContact:
    """Where vertices are within `near` mm of another sheet, or up to `deep` mm beneath it.

    A sheet faces the vertex and is not its neighbourhood: it was more than three edges away in `rest`, the
    same surface at rest. Whether a vertex is beneath any, the winding number tells: across a thin web the
    other side is near, too, but not over it.
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
    found = cKDTree(centres).query_ball_point(surface.vertices, reach + radius)
    counts = np.fromiter((len(f) for f in found), dtype=np.int64, count=len(found))
    vertices = np.repeat(np.arange(len(found)), counts)
    triangles = np.concatenate([np.asarray(f, dtype=np.int64) for f in found])
    facing = np.einsum("ni,ni->n", normals[vertices], surface.triangle_normals()[triangles]) < FACING
    away = rest.vertices[vertices] - rest.vertices[rest.triangles].mean(axis=1)[triangles]
    chosen = facing & (np.linalg.norm(away, axis=1) > 3 * rest.edge_lengths().mean())
    return vertices[chosen], triangles[chosen]


def _at(surface: Surface, vertices: IntArray, triangles: IntArray, places: Array) -> SelfContact:
    feet = barycentric_matrix(places, surface.triangles[triangles], surface.vertices)
    normals = surface.smooth_normals(feet)
    gaps = np.einsum("ni,ni->n", surface.vertices[vertices] - places, normals)
    return SelfContact(vertices, feet, normals, gaps)
