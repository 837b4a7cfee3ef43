"""Coupled prisms on a surface (PriMo: Botsch, Pauly, Gross and Kobbelt 2006).

Each triangle is extruded along the normals of its vertices to a prism that stays rigid. Prisms of
neighbouring triangles share a face at rest. The energy is the sum over edges of w times the mean square of
the gap between the two faces, w = |edge|^2 / (area + area). A vertex of the surface is the mean of what its
prisms make of it; marked vertices are at known places.

Corners C (c, 3) of all prisms give the energy tr(C^T K C) with a constant K. Rotations follow steps of
Newton, or of Gauss and Newton as in Botsch 2006 where the second derivative is not positive; translations, in
which the energy is quadratic, are solved exactly for any rotations.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import trimesh
from scipy.spatial.transform import Rotation

from handpipe.core import Array, ConvergenceError, IntArray
from handpipe.fem.elements import plasticity, polar
from handpipe.fem.linear import NotPositiveDefinite, factorise
from handpipe.mesh.surfaces import Surface

ROUNDS, SETTLED = 500, 1e-5  # at most; mm that a round still moves any vertex by
FIRM = 1e6  # weight of a marked vertex: it is met within about a millionth of the gaps
SHORTEST = 1e-4  # share of a step below which there is no descent
CORNERS = 6  # of a prism: three above, then three below
# Integrals over the unit square of products of the bilinear functions of corners (p, q above; p, q below).
SQUARE = np.kron([[2.0, 1.0], [1.0, 2.0]], [[2.0, 1.0], [1.0, 2.0]]) / 36.0


class Prisms:
    """The energy of a surface at rest, with some vertices at known places.

    rest: vertices (n, 3) in mm; triangles (k, 3); points: known vertices (r,); height: of the prisms in mm,
    half of it on each side of the surface. The higher the prisms, the more bending costs against stretching.
    """

    def __init__(self, rest: Array, triangles: IntArray, points: IntArray, height: float) -> None:
        self.triangles, self.height = triangles, height
        corners = self._extruded(rest)
        self._local = corners - corners.mean(axis=1, keepdims=True)
        self._means = self._vertices_of_corners(len(rest))
        self._marked = self._means[points]
        self._coupling = self._gaps(rest)
        self._matrix = (self._coupling + FIRM * (self._marked.T @ self._marked)).tocsr()
        self._owner = sp.kron(sp.identity(len(triangles)), np.ones((CORNERS, 1)), format="csr")
        self._translations = factorise(_sorted(self._owner.T @ self._matrix @ self._owner))

    def least(self, start: Array, targets: Array) -> Array:
        """Vertices (n, 3) of least energy with the known ones at targets (r, 3), from a start (n, 3)."""
        rotations = self.fitted(start)
        corners = self.placed(rotations, targets)
        for _ in range(ROUNDS):
            step = self._step(rotations, corners, targets)
            motion = float(np.abs(self.vertices(self._motions(rotations) @ step.ravel())).max())
            if motion < SETTLED:
                return self.vertices(corners)
            rotations, corners = self._descended(rotations, corners, targets, step[:, :3])
        raise ConvergenceError(
            "coupled prisms", f"vertices still move by {motion:.2g} mm", "Give fewer marks"
        )

    def fitted(self, x: Array) -> Array:
        """Rotations (k, 3, 3) that best turn prisms at rest into those extruded from vertices x (n, 3)."""
        corners = self._extruded(x)
        corners -= corners.mean(axis=1, keepdims=True)
        return polar(np.einsum("kci,kcj->kij", corners, self._local))[0]

    def placed(self, rotations: Array, targets: Array) -> Array:
        """Corners (6 k, 3) for rotations (k, 3, 3) and the best translations."""
        turned = self._turned(rotations)
        right = self._owner.T @ (self._marked.T @ (FIRM * targets) - self._matrix @ turned)
        return turned + self._owner @ self._translations.solve(right)

    def energy(self, corners: Array) -> float:
        """Energy in mm^2 of corners (6 k, 3)."""
        return float((corners * (self._coupling @ corners)).sum())

    def vertices(self, corners: Array) -> Array:
        """Vertices (n, 3) of the surface between corners (6 k, 3)."""
        return self._means @ corners.reshape(-1, 3)

    def _objective(self, corners: Array, targets: Array) -> float:
        return self.energy(corners) + FIRM * float(((self._marked @ corners - targets) ** 2).sum())

    def _step(self, rotations: Array, corners: Array, targets: Array) -> Array:
        """Rotation vectors and translations (k, 6) of a step of Newton, or else of Gauss and Newton."""
        motions = self._motions(rotations)
        matrix = sp.kron(self._matrix, sp.identity(3), format="csr")
        pull = -self._coupling @ corners + self._marked.T @ (FIRM * (targets - self._marked @ corners))
        normal = motions.T @ matrix @ motions
        try:
            factor = factorise(_sorted(normal + self._curvature(rotations, pull)))
        except NotPositiveDefinite:
            factor = factorise(_sorted(normal))
        return factor.solve(motions.T @ pull.ravel()).reshape(-1, 6)

    def _curvature(self, rotations: Array, pull: Array) -> sp.csr_matrix:
        """What rotations add to the second derivative (6 k, 6 k), since corners move on circles."""
        each = (pull.reshape(-1, CORNERS, 3), self._turned(rotations).reshape(-1, CORNERS, 3))
        products = np.einsum("kci,kcj->kij", *each)
        blocks = np.zeros((len(products), 6, 6))
        traces = np.trace(products, axis1=1, axis2=2)
        blocks[:, :3, :3] = traces[:, None, None] * np.eye(3) - 0.5 * (products + products.transpose(0, 2, 1))
        return plasticity.per_tet_operator(blocks).tocsr()

    def _descended(
        self, rotations: Array, corners: Array, targets: Array, turns: Array
    ) -> tuple[Array, Array]:
        """Rotations and corners after the longest of the steps 1, 1/2, 1/4... that lowers the energy."""
        before, length = self._objective(corners, targets), 1.0
        while length > SHORTEST:
            trial = Rotation.from_rotvec(length * turns).as_matrix() @ rotations
            placed = self.placed(trial, targets)
            if self._objective(placed, targets) < before:
                return trial, placed
            length *= 0.5
        raise ConvergenceError("coupled prisms", "no step lowers the energy", "Give fewer marks")

    def _turned(self, rotations: Array) -> Array:
        """Corners (6 k, 3) about the middles of their prisms."""
        return np.einsum("kij,kcj->kci", rotations, self._local).reshape(-1, 3)

    def _motions(self, rotations: Array) -> sp.csr_matrix:
        """Derivative (18 k, 6 k) of the corners by rotation vectors and translations of their prisms."""
        x, y, z = self._turned(rotations).T
        nil, one = np.zeros_like(x), np.ones_like(x)
        rows = [[nil, z, -y, one, nil, nil], [-z, nil, x, nil, one, nil], [y, -x, nil, nil, nil, one]]
        values = np.array(rows).transpose(2, 0, 1)
        row = np.arange(values.size // 6).reshape(-1, 3, 1)
        column = 6 * np.repeat(np.arange(len(self._local)), CORNERS)[:, None, None] + np.arange(6)
        at = tuple(np.broadcast_to(index, values.shape).ravel() for index in (row, column))
        return sp.csr_matrix((values.ravel(), at))

    def _extruded(self, x: Array) -> Array:
        """Corners (k, 6, 3) of the prisms of a surface with vertices x (n, 3)."""
        offsets = 0.5 * self.height * Surface(x, self.triangles).vertex_normals()
        return np.concatenate([(x + offsets)[self.triangles], (x - offsets)[self.triangles]], axis=1)

    def _vertices_of_corners(self, count: int) -> sp.csr_matrix:
        """Vertices (n, 6 k) as means of corners."""
        vertex = np.tile(self.triangles, (1, 2)).ravel()
        uses = np.bincount(vertex, minlength=count)
        at = vertex, np.arange(len(vertex))
        return sp.csr_matrix((1.0 / uses[vertex], at), shape=(count, len(vertex)))

    def _gaps(self, rest: Array) -> sp.csr_matrix:
        """K (6 k, 6 k) of the energy."""
        pairs, edges = trimesh.graph.face_adjacency(self.triangles, return_edges=True)
        areas = Surface(rest, self.triangles).triangle_areas()
        lengths = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
        weights = lengths**2 / areas[pairs].sum(axis=1)
        sides = [self._corners_of(pairs[:, side], edges) for side in (0, 1)]
        values = np.repeat([1.0, -1.0], 4 * len(edges))
        at = np.tile(np.arange(4 * len(edges)), 2), np.concatenate([side.ravel() for side in sides])
        apart = sp.csr_matrix((values, at), shape=(4 * len(edges), CORNERS * len(self.triangles)))
        return (apart.T @ sp.kron(sp.diags(weights), SQUARE) @ apart).tocsr()

    def _corners_of(self, prisms: IntArray, edges: IntArray) -> IntArray:
        """Corners (e, 4) of prisms (e,) at edges (e, 2): both ends above, then both below."""
        place = (self.triangles[prisms][:, None, :] == edges[:, :, None]).argmax(axis=2)
        above = CORNERS * prisms[:, None] + place
        return np.concatenate([above, above + 3], axis=1)


def _sorted(matrix: sp.spmatrix) -> sp.csr_matrix:
    found = matrix.tocsr()
    found.sort_indices()
    return found
