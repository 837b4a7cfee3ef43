"""An energy near a state, to second order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray
from handpipe.fem.potentials.potential import Potential, Sum


class Expansion:
    """Second-order expansion g . d + d . H d / 2 of an energy in the moves d of some nodes.

    All other nodes stay. It replaces costly energies of a large body where only a few nodes move, by little.

    Parameters
    ----------
    potentials : sequence of Potential
        Their sum is expanded.
    x : array (n, 3)
        Positions in mm around which it is expanded.
    nodes : boolean array (n,)
        Mask of the k nodes that move; positions (k, 3) of the expansion are in their order.
    """

    def __init__(self, potentials: Sequence[Potential], x: Array, nodes: BoolArray) -> None:
        energy, chosen = Sum(potentials), np.repeat(nodes, 3)
        self._start = x[nodes]
        self._gradient = energy.gradient(x)[nodes]
        self._hessian = sp.csr_matrix(energy.hessian(x)[chosen][:, chosen])

    def value(self, x: Array) -> float:
        """Energy in microjoules of the nodes' positions x (k, 3), relative to that at their start."""
        moves = (x - self._start).ravel()
        return float(self._gradient.ravel() @ moves + 0.5 * moves @ (self._hessian @ moves))

    def gradient(self, x: Array) -> Array:
        """Gradient (k, 3) in mN of the nodes' positions: g + H d."""
        moves = (x - self._start).ravel()
        return self._gradient + (self._hessian @ moves).reshape(-1, 3)

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3k, 3k) in mN/mm: H, constant; `project` is ignored."""
        return self._hessian
