"""Passive tissue: a hyperelastic material at the points of any elements."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array
from handpipe.fem.elements import (
    MODELS,
    Material,
    energy_densities,
    piola_stresses,
    semidefinite_stiffnesses,
    stiffnesses,
)
from handpipe.synthetic.continuum.density import DensityPotential
from handpipe.synthetic.continuum.elements import Elements


class Solid(DensityPotential):
    """Energy sum of V psi(F) of a material with one set of constants, or one a cell."""

    by_point = ("_mu", "_lam")

    def __init__(self, elements: Elements, material: Material) -> None:
        super().__init__(elements)
        self._model = MODELS[material.model]
        count, points = elements.volumes.shape
        self._mu, self._lam = (np.repeat(constant, points) for constant in material.lame(count))

    def densities(self, f: Array, points: slice) -> Array:
        """Energy densities (p,) in kPa."""
        return energy_densities(self._model, f, self._mu[points], self._lam[points])

    def stresses(self, f: Array, points: slice) -> Array:
        """First Piola stresses (p, 3, 3) in kPa."""
        return piola_stresses(self._model, f, self._mu[points], self._lam[points])

    def tangents(self, f: Array, points: slice, project: bool) -> Array:
        """Derivatives (p, 9, 9) of the stresses by F in row-major order; semidefinite with `project`."""
        law = semidefinite_stiffnesses if project else stiffnesses
        return law(self._model, f, self._mu[points], self._lam[points])

    def resistance(self) -> Array:
        """Force (n,) in mN on each node with which its cells resist a shear strain of one, at rest."""
        e = self.elements
        mu = self._mu.reshape(e.volumes.shape)
        forces = np.einsum("mq,mqa->ma", 2.0 * mu * e.volumes, np.sqrt((e.gradients**2).sum(axis=3)))
        return np.asarray(np.bincount(e.cells.ravel(), forces.ravel(), len(e.nodes)), dtype=float)

    def volume_ratios(self, x: Array) -> Array:
        """Determinants det F (m, q) at every point, positive where tissue is not inverted."""
        return np.linalg.det(self.deformation_gradients(x))

    def bulk_moduli(self) -> Array:
        """Bulk modulus (m,) in kPa of every cell, at rest."""
        return np.asarray(self._lam + 2.0 / 3.0 * self._mu)[:: self._points]
