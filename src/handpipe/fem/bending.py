"""Bending of triangle meshes, in a form that is quadratic where the rest shape is flat."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from handpipe.fem.points import PointPotential

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Bending(PointPotential):
    """Energy sum over inner edges of c_e / 2 (|K_e x| - |K_e x0|)^2, c_e = 3 k / (A0 + A1).

    K_e is the cotangent stencil of an edge and its two opposite corners (Bergou et al. 2006, A quadratic
    bending model for inextensible surfaces); |K_e x| measures the fold whatever the orientation. stiffness
    k in microjoules (mN mm). With `curved`, the fold at rest is that of `vertices` (n, 3); else rest is flat
    and the energy quadratic.
    """

    def __init__(self, vertices: Array, triangles: IntArray, stiffness: float, curved: bool = False) -> None:
        operator, areas = hinge_operator(vertices, triangles)
        super().__init__(operator)
        self._weights = 3.0 * stiffness / areas
        folds = np.linalg.norm(operator @ vertices, axis=1)
        self._rest = folds if curved else np.zeros(len(folds))
        edge_scale = float(np.sqrt(np.median(areas)))
        self._rounding = 1e-3 * edge_scale  # keeps the norm smooth at zero fold

    def energies(self, points: Array) -> Array:
        squares = (points**2).sum(axis=1)
        norms = np.sqrt(squares + self._rounding**2)
        return 0.5 * self._weights * (squares - 2 * self._rest * norms + self._rest**2)

    def forces(self, points: Array) -> Array:
        norms = np.sqrt((points**2).sum(axis=1) + self._rounding**2)
        return (self._weights * (1 - self._rest / norms))[:, None] * points

    def stiffnesses(self, points: Array, project: bool) -> Array:
        norms = np.sqrt((points**2).sum(axis=1) + self._rounding**2)
        across = self._weights * (1 - self._rest / norms)
        if project:
            across = np.maximum(across, 0.0)
        along = self._weights * self._rest / norms**3
        dyads = points[:, :, None] * points[:, None, :]
        return across[:, None, None] * np.eye(3) + along[:, None, None] * dyads


def hinge_operator(vertices: Array, triangles: IntArray) -> tuple[sp.csr_matrix, Array]:
    """Cotangent stencils K (e, n) of the inner edges, and the areas (e,) of their two triangles together."""
    hinges = inner_edges(triangles)
    x = vertices[hinges]
    e0 = x[:, 1] - x[:, 0]
    areas = np.zeros(len(hinges))
    cotangents = []
    for apex in (2, 3):
        for end in (0, 1):
            u, v = x[:, 1 - end] - x[:, end], x[:, apex] - x[:, end]
            sine = np.linalg.norm(np.cross(u, v), axis=1)
            cotangents.append(np.einsum("ij,ij->i", u, v) / sine)
        areas += 0.5 * np.linalg.norm(np.cross(e0, x[:, apex] - x[:, 0]), axis=1)
    c02, c12, c03, c13 = cotangents
    weights = np.stack([c12 + c13, c02 + c03, -(c02 + c12), -(c03 + c13)], axis=1)
    starts = np.arange(0, hinges.size + 1, 4)
    shape = (len(hinges), len(vertices))
    return sp.csr_matrix((weights.ravel(), hinges.ravel(), starts), shape=shape), areas


def inner_edges(triangles: IntArray) -> IntArray:
    """Edges between two triangles with their opposite corners (e, 4): ends, then apexes."""
    corners = np.asarray(triangles)
    ends = np.concatenate([corners[:, [1, 2]], corners[:, [2, 0]], corners[:, [0, 1]]])
    apexes = np.concatenate([corners[:, 0], corners[:, 1], corners[:, 2]])
    keys = np.sort(ends, axis=1)
    order = np.lexsort((keys[:, 1], keys[:, 0]))
    keys, apexes = keys[order], apexes[order]
    twins = np.flatnonzero((keys[1:] == keys[:-1]).all(axis=1))
    return np.column_stack([keys[twins], apexes[twins], apexes[twins + 1]])
