"""The smoothness of strains, |L S|^2 (Wang 2021 Eq. 5.3), and the inverse of its Hessian.

The plastic strain Laplacian acts on each of the six numbers alone (Wang 2021 Eq. A.2): one factorisation of
the scalar matrix over tets serves all six. Its nullspace, the constant, is left out by a spring on one tet,
which values without a mean do not stretch, and by taking means off: the solution of the Singular Lemma (ii)
without bordering the matrix.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from handpipe.core import Array, InputError, IntArray
from handpipe.fem.linear import factorise
from handpipe.mesh.tets import tet_laplacian
from handpipe.shapes.strains.coarse_strains import CoarseStrains
from handpipe.shapes.strains.stretch import COUNTS

ROOTS = np.sqrt(COUNTS)


class Smoothness:
    """E(S) = |L S|^2 / 2 of log-strains S (m, 6), numbers off the diagonal counted twice.

    With B its Hessian, `root` is B^1/2 and `unroot` the pseudo-inverse of that.
    """

    def __init__(self, tets: IntArray) -> None:
        """Raises `InputError` where tets (m, 4) are not connected by faces, or fewer than two."""
        self.laplacian = tet_laplacian(tets)
        parts = connected_components(self.laplacian, directed=False)[0]
        if parts > 1 or len(tets) < 2:
            problem = f"are {len(tets)}, in {parts} parts that no face connects"
            raise InputError("template", "tets", problem, "Give one connected body of at least two tets")
        pin = sp.csr_matrix(([1.0], ([0], [0])), shape=self.laplacian.shape)
        self._factor = factorise((self.laplacian + pin).tocsr())

    @cached_property
    def coarse(self) -> CoarseStrains:
        """Its smoothest fields."""
        return CoarseStrains(self.laplacian)

    def energy(self, logs: Array) -> float:
        """E(S)."""
        return 0.5 * float(((self.laplacian @ logs) ** 2 @ COUNTS).sum())

    def gradient(self, logs: Array) -> Array:
        """B S (m, 6)."""
        return COUNTS * (self.laplacian @ (self.laplacian @ logs))

    def root(self, logs: Array) -> Array:
        """B^1/2 S (m, 6)."""
        return ROOTS * (self.laplacian @ logs)

    def unroot(self, values: Array) -> Array:
        """Strains S (m, 6) of zero mean with B^1/2 S = values, up to the mean of these."""
        return self.inverse(values) / ROOTS

    def inverse(self, values: Array) -> Array:
        """Pseudo-inverse of L times values (m, k)."""
        columns = np.asfortranarray(values)
        found = self._factor.solve(columns - columns.mean(axis=0))
        return found - found.mean(axis=0)
