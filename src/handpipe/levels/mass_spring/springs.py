"""Springs between the nodes of a surface: along its edges, and across them against bending."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Surface


class Springs(NamedTuple):
    """Springs between nodes.

    Parameters
    ----------
    ends : array (s, 2) of int
        Nodes of each spring.
    lengths : array (s,)
        Lengths in mm at which they are free of force.
    stiffness : array (s,)
        Stiffness of each spring, of any one unit.
    """

    ends: IntArray
    lengths: Array
    stiffness: Array

    @staticmethod
    def of(surface: Surface, across: float = 0.25, rest: float = 1.0) -> Springs:
        """Springs of a surface.

        Parameters
        ----------
        surface : Surface
            Surface, mm.
        across : float
            Stiffness of a spring between the two corners that face an edge, where that of an edge is 1: it
            resists bending.
        rest : float
            Length at which a spring is free of force, over that on the surface.

        Returns
        -------
        Springs
            Springs on edges, then those across.
        """
        edges, facing = _edges(surface.triangles)
        ends = np.concatenate([edges, facing])
        lengths = np.linalg.norm(surface.vertices[ends[:, 0]] - surface.vertices[ends[:, 1]], axis=1)
        return Springs(ends, rest * lengths, np.repeat([1.0, across], [len(edges), len(facing)]))

    def laplacian(self, nodes: int) -> sparse.csr_matrix:
        """Matrix (nodes, nodes) of the springs as if their lengths at rest were zero."""
        i, j = self.ends.T
        weights = sparse.coo_matrix((self.stiffness, (i, j)), shape=(nodes, nodes)).tocsr()
        weights = weights + weights.T
        return (sparse.diags(np.asarray(weights.sum(axis=1)).ravel()) - weights).tocsr()


def _edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (e, 2), and the corners (f, 2) that face each edge between two triangles."""
    halves = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    apexes = np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])
    edges, number = np.unique(np.sort(halves, axis=1), axis=0, return_inverse=True)
    order = np.argsort(number.ravel(), kind="stable")
    number, apexes = number.ravel()[order], apexes[order]
    pairs = np.flatnonzero(number[1:] == number[:-1])
    return edges, np.column_stack([apexes[pairs], apexes[pairs + 1]])


@njit(cache=True)
def forces(x: Any, springs: Any, targets: Any, holding: Any, out: Any) -> float:
    """Energy of nodes (n, 3); its gradient goes into out (n, 3).

    holding (n,): stiffness of springs without length from the nodes to targets (n, 3).
    """
    ends, lengths, stiffness = springs
    energy = 0.0
    for i in range(len(x)):
        for c in range(3):
            apart = x[i, c] - targets[i, c]
            out[i, c] = holding[i] * apart
            energy += 0.5 * holding[i] * apart * apart
    for s in range(len(ends)):
        i, j = ends[s, 0], ends[s, 1]
        a, b, c = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
        length = np.sqrt(a * a + b * b + c * c)
        longer = length - lengths[s]
        energy += 0.5 * stiffness[s] * longer * longer
        pull = stiffness[s] * longer / max(length, 1e-12)
        out[i, 0] += pull * a
        out[i, 1] += pull * b
        out[i, 2] += pull * c
        out[j, 0] -= pull * a
        out[j, 1] -= pull * b
        out[j, 2] -= pull * c
    return energy
