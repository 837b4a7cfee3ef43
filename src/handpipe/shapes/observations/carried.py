"""Potentials of one mesh that act on another one, which carries its vertices."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array
from handpipe.fem.potentials import Potential


class Carried:
    """Energy of points W x; W (k, n) takes vertices x (n, 3) to the points that a potential acts on."""

    def __init__(self, potential: Potential, carry: sp.csr_matrix) -> None:
        self.potential, self.carry = potential, carry
        self._coordinates = sp.kron(carry, sp.eye(3), format="csr")

    def value(self, x: Array) -> float:
        """Energy in microjoules of the points W x."""
        return self.potential.value(self.carry @ x)

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: W^T times the potential's."""
        return np.asarray(self.carry.T @ self.potential.gradient(self.carry @ x))

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm: W^T H W; with `project`, of the potential's semidefinite H."""
        inner = self.potential.hessian(self.carry @ x, project)
        found = (self._coordinates.T @ inner @ self._coordinates).tocsr()
        found.sort_indices()
        return found

    def max_step(self, x: Array, step: Array) -> float:
        """As far as the potential itself allows."""
        if not hasattr(self.potential, "max_step"):
            return 1.0
        return float(self.potential.max_step(self.carry @ x, self.carry @ step))

    def refresh(self, x: Array) -> None:
        """Between Newton steps."""
        if hasattr(self.potential, "refresh"):
            self.potential.refresh(self.carry @ x)
