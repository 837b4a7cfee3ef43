"""Resistance of tissue to crushing, so that no element's volume vanishes."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array
from handpipe.synthetic.continuum.density import DensityPotential, add_stiffness, semidefinite
from handpipe.synthetic.continuum.determinant import cofactors, second_derivatives
from handpipe.synthetic.continuum.elements import Elements

CRUSHED = 0.3  # of its volume at rest: where the resistance begins
STEEPEST = 0.02  # of that: below, it grows quadratically, so that a bad start has an energy
LAST = 2e-3  # the same where `STEEPEST` is too weak: over 3 MPa press on small tets at a muscle's end


class QuadratureCrushing(DensityPotential):
    """Energy sum of V k b(J / 0.3) over points with J = det F < 0.3; b(s) = -(s - 1)^2 ln s, k in kPa.

    Below s = `steepest` b continues as its parabola there: twice continuous, and finite for an inverted
    start, which stable laws alone would leave inverted.
    """

    def __init__(self, elements: Elements, stiffness: float, steepest: float = STEEPEST) -> None:
        super().__init__(elements)
        self.stiffness, self.steepest = stiffness, steepest

    def to_the_end(self, last: float = LAST) -> QuadratureCrushing:
        """The same resistance, logarithmic until almost no volume of an element is left."""
        return QuadratureCrushing(self.elements, self.stiffness, last)

    def densities(self, f: Array, points: slice) -> Array:
        """Energy densities (p,) in kPa; zero where J is 0.3 or more."""
        return self.stiffness * self._barrier(np.linalg.det(f))[0]

    def stresses(self, f: Array, points: slice) -> Array:
        """First Piola stresses (p, 3, 3) in kPa; zero where J is 0.3 or more."""
        slope = self.stiffness * self._barrier(np.linalg.det(f))[1]
        out = np.zeros_like(f)
        active = slope != 0
        out[active] = slope[active, None, None] * cofactors(f[active])
        return out

    def tangents(self, f: Array, points: slice, project: bool) -> Array:
        """Derivatives (p, 9, 9) of the stresses by F in row-major order; semidefinite with `project`."""
        slope, curvature = (self.stiffness * d for d in self._barrier(np.linalg.det(f))[1:])
        normal = cofactors(f).reshape(-1, 9)
        out = curvature[:, None, None] * normal[:, :, None] * normal[:, None, :]
        exact = out + slope[:, None, None] * second_derivatives(f)
        return semidefinite(exact) if project else exact

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm, assembled only from cells with a point of J < 0.3."""
        f = self.deformation_gradients(x)
        crushed = np.flatnonzero((np.linalg.det(f) < CRUSHED).any(axis=1))
        data = self.elements.pattern.data()
        tangents = self.tangents(f[crushed].reshape(-1, 3, 3), slice(None), project)
        add_stiffness(self.elements, crushed, tangents, data)
        return self.elements.pattern.matrix(data)

    def _barrier(self, volume: Array) -> tuple[Array, Array, Array]:
        """The function of J, its first and second derivative, each (p,)."""
        share = np.minimum(volume / CRUSHED, 1.0)
        at = np.maximum(share, self.steepest)
        log, gap = np.log(at), at - 1.0
        value = -(gap**2) * log
        first = -2 * gap * log - gap**2 / at
        second = -2 * log - 4 * gap / at + gap**2 / at**2
        beyond = share - at
        value += beyond * (first + 0.5 * beyond * second)
        first += beyond * second
        return value, first / CRUSHED, second / CRUSHED**2
