"""The neo-Hookean law of CalculiX at the points of our elements, to compare engines under one law."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array
from handpipe.fem.elements import Material
from handpipe.synthetic.continuum.density import DensityPotential, semidefinite
from handpipe.synthetic.continuum.determinant import cofactors, second_derivatives
from handpipe.synthetic.continuum.elements import Elements


class IsochoricSolid(DensityPotential):
    """Energy sum of V (mu/2 (J^(-2/3) |F|^2 - 3) + K/2 (J - 1)^2): C10 = mu / 2 and D1 = 2 / K.

    The shear modulus mu and the bulk modulus K are those of the material at small strains, in kPa. The energy
    is infinite where a point is inverted.
    """

    by_point = ("mu", "bulk")

    def __init__(self, elements: Elements, material: Material) -> None:
        super().__init__(elements)
        count, points = elements.volumes.shape
        mu, lam = material.lame(count)
        self.mu, self.bulk = np.repeat(mu, points), np.repeat(lam + 2.0 / 3.0 * mu, points)

    @property
    def moduli(self) -> tuple[Array, Array]:
        """Shear and bulk moduli (m,) in kPa of each cell."""
        return self.mu[:: self._points], self.bulk[:: self._points]

    def densities(self, f: Array, points: slice) -> Array:
        """Energy densities (p,) in kPa."""
        volume = np.linalg.det(f)
        valid = volume > 0
        squares = (f**2).sum(axis=(1, 2)) * np.where(valid, volume, 1.0) ** (-2 / 3)
        energy = 0.5 * self.mu[points] * (squares - 3.0) + 0.5 * self.bulk[points] * (volume - 1.0) ** 2
        return np.where(valid, energy, np.inf)

    def stresses(self, f: Array, points: slice) -> Array:
        """First Piola stresses (p, 3, 3) in kPa."""
        shear, slope = self._slopes(f, points)[:2]
        return shear[:, None, None] * f + slope[:, None, None] * cofactors(f)

    def tangents(self, f: Array, points: slice, project: bool) -> Array:
        """Derivatives (p, 9, 9) of the stresses by F in row-major order; semidefinite with `project`."""
        shear, slope, mixed, curvature = (v[:, None, None] for v in self._slopes(f, points))
        along, normal = f.reshape(-1, 9), cofactors(f).reshape(-1, 9)
        crossed = along[:, :, None] * normal[:, None, :]
        exact = shear * np.eye(9) + mixed * (crossed + np.swapaxes(crossed, 1, 2))
        exact += curvature * normal[:, :, None] * normal[:, None, :] + slope * second_derivatives(f)
        return semidefinite(exact) if project else exact

    def _slopes(self, f: Array, points: slice) -> tuple[Array, Array, Array, Array]:
        """Derivatives (p,) of the density: twice that by |F|^2, by J, twice the mixed one, by J twice."""
        volume, squares = np.linalg.det(f), (f**2).sum(axis=(1, 2))
        shear, bulk = self.mu[points] * volume ** (-2 / 3), self.bulk[points]
        slope = bulk * (volume - 1.0) - shear * squares / (3 * volume)
        curvature = bulk + 5 * shear * squares / (9 * volume**2)
        return shear, slope, -2 * shear / (3 * volume), curvature
