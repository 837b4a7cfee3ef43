"""Pushes that bring skin out of other skin: at its vertices, and where its edges cross its triangles."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.fem.contact import Contact
from handpipe.fem.potentials import Potential
from handpipe.mesh.contact import SelfContact, crossings, self_contact, ways_out
from handpipe.mesh.surfaces import Surface, barycentric_matrix
from handpipe.tissues.fat.skin_contact import BITE, DEEP, TOUCH


def crossing_vertices(skin: Surface) -> IntArray:
    """Vertices (k,) of a skin's edges and triangles that cross, sorted."""
    found = crossings(skin)
    edges, triangles = skin.edges()[found[:, 0]], skin.triangles[found[:, 1]]
    return np.unique(np.concatenate([edges.ravel(), triangles.ravel()]))


def pushes(
    rest: Surface, skin: Surface, matrix: sparse.csr_matrix, stiffness: Array, margins: Array
) -> list[Potential]:
    """Contact that moves skin (v vertices) out of other skin, to `margins` (v,) in mm beyond it.

    Other parameters as of `skin_on_skin`. Vertices alone do not show every crossing: an edge may cross a
    triangle with both its ends outside.
    """
    found = self_contact(skin, rest, TOUCH, DEEP)
    parts: list[Potential] = []
    if len(found.vertices):
        parts.append(_from_sheets(found, matrix, stiffness, margins))
    pairs = crossings(skin)
    if len(pairs):
        parts.append(_from_crossings(skin, pairs, matrix, stiffness, margins))
    return parts


def _from_sheets(found: SelfContact, matrix: sparse.csr_matrix, stiffness: Array, margins: Array) -> Contact:
    """Contact of vertices with the sheets that they face."""
    targets = np.minimum(margins[found.vertices], found.gaps + BITE)
    apart = matrix[found.vertices] - found.feet @ matrix
    return Contact(apart, targets[:, None] * found.normals, found.normals, stiffness[found.vertices])


def _from_crossings(
    skin: Surface, pairs: IntArray, matrix: sparse.csr_matrix, stiffness: Array, margins: Array
) -> Contact:
    """Contact of the places where edges cross triangles, along the difference of the two sheets' normals."""
    edges, triangles = skin.edges()[pairs[:, 0]], skin.triangles[pairs[:, 1]]
    places, on_edges = _places(skin, edges, triangles)
    feet = barycentric_matrix(places, triangles, skin.vertices)
    normals = skin.vertex_normals()
    own = skin.triangle_normals()[pairs[:, 1]]
    directions = ways_out(feet @ normals - on_edges @ normals, own)
    targets = margins[edges].max(axis=1)[:, None] * directions
    return Contact((on_edges - feet) @ matrix, targets, directions, feet @ stiffness)


def _places(skin: Surface, edges: IntArray, triangles: IntArray) -> tuple[Array, sparse.csr_matrix]:
    """Where edges (c, 2) cross the planes of triangles (c, 3): places (c, 3), weights (c, v) of the ends."""
    a, b, c = np.moveaxis(skin.vertices[triangles], 1, 0)
    heights = np.einsum("nki,ni->nk", skin.vertices[edges] - a[:, None], np.cross(b - a, c - a))
    share = heights[:, 0] / (heights[:, 0] - heights[:, 1])
    rows = np.repeat(np.arange(len(edges)), 2)
    weights = np.column_stack([1 - share, share]).ravel()
    matrix = sparse.csr_matrix((weights, (rows, edges.ravel())), shape=(len(edges), len(skin.vertices)))
    return matrix @ skin.vertices, matrix
