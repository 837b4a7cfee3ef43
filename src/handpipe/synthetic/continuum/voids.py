"""Suction: voids between bodies do not open, since the atmosphere presses their surfaces together."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, IntArray
from handpipe.fem.patterns import Pattern


class VoidPressure:
    """Energy p V of a void of volume V: a follower pressure p in kPa that acts on all of its walls.

    Parameters
    ----------
    walls : integer array (k, 3)
        Triangles of nodes that bound the void, seen counter-clockwise from within the tissue: the closed
        surface of each body in it, turned to face into the body, and that of its outer wall, facing out. What
        lies still in the void, as bones, changes its volume by a constant and is left out.
    count : int
        Number of nodes n.
    pressure : float
        Pressure p in kPa.
    """

    def __init__(self, walls: IntArray, count: int, pressure: float) -> None:
        self.walls = np.ascontiguousarray(walls, dtype=np.int64)
        self.pressure = pressure
        self.pattern = Pattern.of_cells(self.walls, count)

    def volume(self, x: Array) -> float:
        """Volume in mm^3 of the void at x (n, 3), together with that of what is left out."""
        a, b, c = (x[self.walls[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    def value(self, x: Array) -> float:
        """Energy in microjoules."""
        return self.pressure * self.volume(x)

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force."""
        out = np.zeros_like(x)
        np.add.at(out, self.walls, self._forces(x))
        return out

    def force_sizes(self, x: Array) -> Array:
        """Sum (n,) of the sizes in mN of the forces of triangles on each node: p A / 3 each."""
        a, b, c = (x[self.walls[:, i]] for i in range(3))
        sizes = self.pressure / 6.0 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
        # The stubs have no floats for weighted counts.
        return np.bincount(self.walls.ravel(), np.repeat(sizes, 3), len(x))  # type: ignore[return-value]

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Exact second derivative (3n, 3n) in mN/mm, symmetric as walls are closed; zero with `project`.

        A pressure has a stiffness of both signs. Its triangles' parts depend on the origin: only their sum
        has a meaning, and no part of it can be projected.
        """
        data = self.pattern.data()
        if not project:
            corners = self.pressure / 6.0 * x[self.walls]
            for first, second, third in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                cross = _cross_matrices(corners[:, third])
                self._add(-cross, first, second, data)
                self._add(cross, second, first, data)
        return self.pattern.matrix(data)

    def _add(self, blocks: Array, row: int, column: int, data: Array) -> None:
        """Add blocks (k, 3, 3), one a triangle, that couple two of its corners, to the pattern's data."""
        begin = self.pattern.slots.reshape(-1, 3, 3)[:, row, column].astype(np.int64)
        stride = self.pattern.strides[self.walls[:, row]]
        at = (begin[:, None] + np.arange(3) * stride[:, None])[:, :, None] + np.arange(3)
        data += np.bincount(at.ravel(), blocks.ravel(), len(data))

    def _forces(self, x: Array) -> Array:
        """Gradient (k, 3, 3) of each triangle's energy by its corners."""
        a, b, c = (x[self.walls[:, i]] for i in range(3))
        return self.pressure / 6.0 * np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def _cross_matrices(vectors: Array) -> Array:
    """Matrices (k, 3, 3) that take u to v x u."""
    out = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -z, y, -x
    return out - np.swapaxes(out, 1, 2)
