"""Data that the minimisations along a path share, computed once."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray
from handpipe.fem.linear.system_sequence import SystemSequence
from handpipe.fem.minimisation.reduction import FreeBlock
from handpipe.fem.potentials.potential import Sum, same_pattern


class Workspace:
    """Linear systems, the pattern of the unknowns' block, and the last plain Hessian.

    `constrained` is True once no rigid-body mode was found to be unconstrained.
    """

    def __init__(
        self,
        rest: Array,
        coarse: sp.csr_matrix | None = None,
        single: bool = False,
        earlier: Workspace | None = None,
    ) -> None:
        """Empty workspace; rest (n, 3): positions at rest or near it; coarse, single: as of `Options`.

        earlier: a workspace that is no longer used, whose analyses of patterns serve again.
        """
        self.systems = SystemSequence(rest=rest, coarse=coarse, single=single)
        if earlier is not None:
            self.systems.analysed_by(earlier.systems)
        self.constrained = False
        self._block: FreeBlock | None = None
        self._free = np.zeros(0, dtype=bool)
        self._tangent: tuple[Sum, Array, sp.csr_matrix] | None = None

    def block(self, matrix: sp.csr_matrix, free: BoolArray) -> sp.csr_matrix:
        """The rows and columns of the unknowns, a mask (3n,)."""
        known = self._block is not None and np.array_equal(free, self._free)
        if not known or not same_pattern(self._block.source, matrix):  # type: ignore[union-attr]
            self._block, self._free = FreeBlock(matrix, free), free
        assert self._block is not None
        return self._block.matrix(matrix)

    def keep(self, energy: Sum, x: Array, matrix: sp.csr_matrix) -> None:
        """Keep the plain Hessian (3n, 3n) of an energy at x (n, 3)."""
        self._tangent = energy, x, matrix

    def tangent(self, energy: Sum | None, x: Array, near: float) -> sp.csr_matrix | None:
        """The Hessian kept, if it was made within `near` mm of x (n, 3), and for this energy where given."""
        if self._tangent is None or (energy is not None and self._tangent[0] is not energy):
            return None
        place = self._tangent[1]
        same = place is x or (place.shape == x.shape and np.abs(place - x).max() <= near)
        return self._tangent[2] if same else None
