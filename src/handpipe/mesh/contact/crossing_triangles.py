"""Where triangles cross one another, by their edges: a check that is independent of how they were made."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.contact.contact_toolkit import ipctk
from handpipe.mesh.surfaces.surface import Surface

ROUNDING = 1e-12  # mm^3, of six times a volume
FACING = 0.3  # length of the difference of two normals: below it, the sheets do not face one another


def crossings(surface: Surface, allowed: ipctk.CollisionFilter | None = None) -> IntArray:
    """Where edges of a surface pass through its triangles.

    Parameters
    ----------
    surface : Surface
        Surface in mm.
    allowed : CollisionFilter, optional
        Which pairs of vertices may collide; an edge and a triangle of which no pair may are left out.

    Returns
    -------
    array (c, 2) of int
        Index of an edge in `surface.edges()` and of a triangle that it crosses; they share no vertex.
    """
    edges, triangles, points = surface.edges(), surface.triangles, surface.vertices
    search = ipctk.LBVH()
    if allowed is not None:
        search.can_vertices_collide = allowed
    search.build(points, edges.astype(np.int32), triangles.astype(np.int32))
    near = search.detect_edge_face_candidates()
    pairs = np.array([(c.edge_id, c.face_id) for c in near], dtype=np.int64).reshape(-1, 2)
    ends, corners = edges[pairs[:, 0]], triangles[pairs[:, 1]]
    apart = (ends[:, :, None] != corners[:, None, :]).all(axis=(1, 2))
    pairs, ends, corners = pairs[apart], points[ends[apart]], points[corners[apart]]
    return pairs[_cross(ends, corners)]


def ways_out(between: Array, own: Array) -> Array:
    """Directions that part two sheets where they cross.

    Parameters
    ----------
    between : array (c, 3)
        Differences of the unit normals of the crossed sheet and of the other one.
    own : array (c, 3)
        Unit normals of the crossed triangles.

    Returns
    -------
    array (c, 3)
        Directions of the differences; `own` where the sheets do not face one another.
    """
    lengths = np.linalg.norm(between, axis=1, keepdims=True)
    return np.where(lengths > FACING, between / np.maximum(lengths, FACING), own)


def _cross(ends: Array, corners: Array) -> BoolArray:
    """Whether segments (n, 2, 3) pass through triangles (n, 3, 3), by the signs of five volumes."""
    a, b, c = np.moveaxis(corners, 1, 0)
    p, q = np.moveaxis(ends, 1, 0)
    # A triangle that an edge only touches, or that lies in one plane with it, is not crossed.
    from_p, from_q = _volume(a, b, c, p), _volume(a, b, c, q)
    sides = (from_p * from_q < 0) & (np.minimum(np.abs(from_p), np.abs(from_q)) > ROUNDING)
    around = np.stack([_volume(p, q, a, b), _volume(p, q, b, c), _volume(p, q, c, a)])
    return sides & ((around >= 0).all(axis=0) | (around <= 0).all(axis=0))


def _volume(a: Array, b: Array, c: Array, d: Array) -> Array:
    return np.einsum("ni,ni->n", np.cross(b - a, c - a), d - a)
