"""Midpoints of a tet mesh's edges: nodes of quadratic tets, vertices of the mesh refined once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.mesh.tets import EDGES, TetMesh

# Corners 0 to 3 and midpoints 4 to 9 in the order of EDGES.
AT_CORNERS = np.array([[0, 4, 5, 6], [4, 1, 7, 8], [5, 7, 2, 9], [6, 8, 9, 3]])
# The octahedron inside, cut along the diagonal between the midpoints of two opposite edges.
INSIDE = np.array(
    [
        [[4, 9, 5, 7], [4, 9, 7, 8], [4, 9, 8, 6], [4, 9, 6, 5]],
        [[5, 8, 4, 7], [5, 8, 7, 9], [5, 8, 9, 6], [5, 8, 6, 4]],
        [[6, 7, 4, 5], [6, 7, 5, 9], [6, 7, 9, 8], [6, 7, 8, 4]],
    ]
)
DIAGONALS = np.array([[4, 9], [5, 8], [6, 7]])


@dataclass(frozen=True, eq=False)
class Midpoints:
    """Nodes (n, 3): the vertices, then every edge's midpoint; cells (m, 10): corners, then midpoints."""

    nodes: Array
    cells: IntArray
    edges: IntArray

    @staticmethod
    def build(mesh: TetMesh) -> Midpoints:
        """Of a mesh's edges, sorted by their vertices; `edges` (e, 2) are the ends of each."""
        pairs = np.sort(mesh.tets[:, EDGES], axis=2).reshape(-1, 2)
        edges, inverse = np.unique(pairs, axis=0, return_inverse=True)
        count = len(mesh.vertices)
        nodes = np.concatenate([mesh.vertices, mesh.vertices[edges].mean(axis=1)])
        return Midpoints(nodes, np.column_stack([mesh.tets, count + inverse.reshape(-1, 6)]), edges)

    def on_faces(self, faces: IntArray) -> IntArray:
        """Nodes (k,) on triangles (f, 3) of vertices: their corners and the midpoints of their edges."""
        count = len(self.nodes) - len(self.edges)
        pairs = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        return np.unique(np.concatenate([faces.ravel(), count + self.numbers(pairs)]))

    def numbers(self, pairs: IntArray) -> IntArray:
        """The number (p,) among `edges` of pairs (p, 2) of vertices, smaller one first."""
        count = len(self.nodes) - len(self.edges)
        keys = self.edges[:, 0] * count + self.edges[:, 1]
        return np.searchsorted(keys, pairs[:, 0] * count + pairs[:, 1])


def refine(mesh: TetMesh) -> tuple[TetMesh, IntArray]:
    """Every tet cut into eight, with the nodes of `Midpoints`, and the parent (8 m,) of each.

    The inner octahedron is cut along its shortest diagonal, which keeps shapes best (Bey 1995).
    """
    middle = Midpoints.build(mesh)
    ends = middle.nodes[middle.cells[:, DIAGONALS]]
    shortest = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).argmin(axis=1)
    local = np.concatenate([np.broadcast_to(AT_CORNERS, (len(mesh.tets), 4, 4)), INSIDE[shortest]], axis=1)
    tets = np.take_along_axis(middle.cells, local.reshape(-1, 32), axis=1).reshape(-1, 4)
    refined = TetMesh(middle.nodes, tets)
    turned = refined.volumes() < 0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return TetMesh(middle.nodes, tets), np.repeat(np.arange(len(mesh.tets)), 8)
