"""Points of a body that are attached to known places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray


@dataclass(frozen=True)
class Attached:
    """Points of a tet mesh with the targets that they are attached to.

    Parameters
    ----------
    matrix : sparse matrix (t, n)
        Weights of the mesh's vertices for each point.
    targets : array (t, 3)
        Targets in mm.
    """

    matrix: sparse.csr_matrix
    targets: Array

    @staticmethod
    def vertices(ids: IntArray, targets: Array, count: int) -> Attached:
        """Vertices with indices ids (t,) of a mesh with `count` vertices."""
        t = len(ids)
        return Attached(sparse.csr_matrix((np.ones(t), ids, np.arange(t + 1)), shape=(t, count)), targets)

    @staticmethod
    def nothing(count: int) -> Attached:
        """No point of a mesh with `count` vertices."""
        return Attached(sparse.csr_matrix((0, count)), np.zeros((0, 3)))

    def errors(self, x: Array) -> Array:
        """Offsets (t, 3) from the targets."""
        return self.matrix @ x - self.targets

    def carried(self, carry: sparse.csr_matrix) -> Attached:
        """The same points by the vertices of a mesh that `carry` (n, n1) takes to those of this one."""
        return Attached((self.matrix @ carry).tocsr(), self.targets)

    def chosen(self, numbers: IntArray) -> Attached:
        """Those of numbers (k,)."""
        return Attached(self.matrix[numbers], self.targets[numbers])
