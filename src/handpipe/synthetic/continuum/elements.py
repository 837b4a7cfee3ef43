"""Finite elements on tets: nodes, shape gradients at quadrature points, interpolation to any point."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.patterns import Pattern
from handpipe.fem.potentials import shape_gradients
from handpipe.mesh.tets import EDGES, Embedding, TetMesh
from handpipe.synthetic.continuum.refinement import Midpoints

# Four points exact for quadratic polynomials (Hammer and Stroud 1956), as barycentric coordinates.
NEAR, FAR = (5 + 3 * np.sqrt(5)) / 20, (5 - np.sqrt(5)) / 20
FOUR_POINTS = np.full((4, 4), FAR) + (NEAR - FAR) * np.eye(4)


@dataclass(frozen=True, eq=False)
class Elements:
    """Cells (m, k) of nodes (n, 3); at each cell's q points shape gradients (m, q, k, 3) and volumes (m, q).

    The nodes begin with the vertices of `mesh`.
    """

    mesh: TetMesh
    nodes: Array
    cells: IntArray
    gradients: Array
    volumes: Array

    @staticmethod
    def linear(mesh: TetMesh) -> Elements:
        """Four nodes a tet, one point."""
        gradients, volumes = shape_gradients(mesh.vertices, mesh.tets)
        return Elements(mesh, mesh.vertices, mesh.tets, gradients[:, None], volumes[:, None])

    @staticmethod
    def quadratic(mesh: TetMesh) -> Elements:
        """Ten nodes a tet, straight edges at rest, four points."""
        barycentric, volumes = shape_gradients(mesh.vertices, mesh.tets)
        middle, at = Midpoints.build(mesh), FOUR_POINTS
        corner = np.einsum("qc,mcd->mqcd", 4 * at - 1, barycentric)
        first, second = EDGES.T
        edge = np.einsum("qe,med->mqed", 4 * at[:, first], barycentric[:, second])
        edge += np.einsum("qe,med->mqed", 4 * at[:, second], barycentric[:, first])
        gradients = np.concatenate([corner, edge], axis=2)
        return Elements(
            mesh, middle.nodes, middle.cells, gradients, np.repeat(volumes[:, None] / 4, 4, axis=1)
        )

    def prolongation(self) -> sp.csr_matrix:
        """Matrix (n, v) that carries fields of linear tets, at the mesh's v vertices, to the nodes."""
        count = len(self.mesh.vertices)
        edges = (
            Midpoints.build(self.mesh).edges if len(self.nodes) > count else np.zeros((0, 2), dtype=np.int64)
        )
        halves = np.full(2 * len(edges), 0.5)
        rows = np.repeat(np.arange(len(edges)), 2)
        middle = sp.csr_matrix((halves, (rows, edges.ravel())), shape=(len(edges), count))
        return sp.vstack([sp.eye(count), middle], format="csr")

    def part(self, cells: IntArray) -> Elements:
        """Some of the cells, in the order of their numbers (p,); nodes stay."""
        return replace(
            self,
            cells=self.cells[cells],
            gradients=self.gradients[cells],
            volumes=self.volumes[cells],
        )

    def nodes_of(self, cells: BoolArray) -> BoolArray:
        """The nodes (n,) of some cells (m,)."""
        nodes = np.zeros(len(self.nodes), dtype=bool)
        nodes[self.cells[cells]] = True
        return nodes

    def touching(self, nodes: BoolArray) -> BoolArray:
        """The cells (m,) that have one of some nodes (n,)."""
        return np.asarray(nodes[self.cells].any(axis=1))

    def among(self, cells: BoolArray, nodes: BoolArray) -> Elements:
        """Some of the cells (m,), of the nodes of a mask (n,) that has all of theirs, in their order."""
        number, corners = np.cumsum(nodes) - 1, nodes[: len(self.mesh.vertices)]
        used = number[self.cells[cells]]
        mesh = TetMesh(self.mesh.vertices[corners], used[:, :4])
        return Elements(mesh, self.nodes[nodes], used, self.gradients[cells], self.volumes[cells])

    @cached_property
    def pattern(self) -> Pattern:
        """Pattern of a Hessian."""
        return Pattern.of_cells(self.cells, len(self.nodes))

    def interpolation(self, points: Array) -> sp.csr_matrix:
        """Matrix (p, n) that carries any field of the nodes to points (p, 3) of the whole mesh."""
        embedding = Embedding.embed(points, self.mesh)
        if self.cells.shape[1] == 4:
            return embedding.matrix(len(self.nodes))
        at = embedding.weights
        shapes = np.column_stack([at * (2 * at - 1), 4 * at[:, EDGES[:, 0]] * at[:, EDGES[:, 1]]])
        pairs = np.sort(embedding.cells[:, EDGES], axis=2).reshape(-1, 2)
        number = Midpoints.build(self.mesh).numbers(pairs).reshape(-1, 6)
        columns = np.column_stack([embedding.cells, len(self.mesh.vertices) + number])
        rows = np.repeat(np.arange(len(points)), 10)
        shape = (len(points), len(self.nodes))
        return sp.csr_matrix((shapes.ravel(), (rows, columns.ravel())), shape=shape)
