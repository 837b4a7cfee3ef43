"""Viscosity over a time step, as the energy of an elastic body if it rested where the step began."""

from __future__ import annotations

import copy

import scipy.sparse as sp

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.fem.potentials.elastic import Elastic


class Viscosity:
    """Energy tau / h times that of a body at rest in x0: with it, the least energy is a Kelvin-Voigt solid's.

    Beside its elastic stress such a solid has one that is tau times the elastic modulus times the rate of
    strain. Over an implicit Euler step of length h that rate is the strain from x0, over h. Rigid motions
    meet no resistance, and a body that has come to rest is where it would be without viscosity.

    Parameters
    ----------
    body : Elastic
        The body. Its plastic strains do not count: they do not say how it moves.
    x : array (n, 3)
        Positions x0 in mm at the beginning of the step, with no tet inverted.
    ratio : float
        Retardation time tau over the length h of the step, zero or more.

    Raises
    ------
    InputError
        If the ratio is negative, or a tet is inverted in x0.
    """

    def __init__(self, body: Elastic, x: Array, ratio: float) -> None:
        if not ratio >= 0:
            raise InputError("Viscosity", "ratio", f"is {ratio}", "Give zero or more")
        self._resting = body.resting(x, ratio)

    def value(self, x: Array) -> float:
        """Energy in microjoules; zero at x0."""
        return self._resting.value(x)

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the viscous force."""
        return self._resting.gradient(x)

    def force_sizes(self, x: Array) -> Array:
        """Sum (n,) of the sizes in mN of the viscous forces that tets put on each vertex."""
        return self._resting.force_sizes(x)

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Exact second derivative (3n, 3n) in mN/mm; with `project`, made semidefinite tet by tet."""
        return self._resting.hessian(x, project)

    def near(self, moving: BoolArray, kept: IntArray) -> Viscosity:
        """The energy of the tets that have a vertex of a mask (n,), as `Sum.near` says."""
        other = copy.copy(self)
        other._resting = self._resting.near(moving, kept)
        return other
