"""Inertia of an implicit Euler step as a potential, so that the solver of equilibria takes time steps."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from handpipe.core import Array, InputError, IntArray


class Inertia:
    """Energy |x - (x0 + h v0)|_M^2 / (2 h^2): with it, the least energy is the next implicit Euler step.

    The Hessian M / h^2 is exact and constant. kg mm^2 / s^2 is a microjoule, so no factor of units appears.
    Implicit Euler damps: the amplitude of a mode of frequency omega is multiplied by
    1 / sqrt(1 + (h omega)^2) in each step.

    Parameters
    ----------
    mass : sparse matrix (n, n)
        Mass M in kg (`mass_matrix`).
    x : array (n, 3)
        Positions x0 in mm at the beginning of the step.
    velocity : array (n, 3)
        Velocities v0 in mm/s at the beginning of the step.
    time_step : float
        Length h of the step in s, above zero.

    Raises
    ------
    InputError
        If the time step is not above zero.
    """

    def __init__(self, mass: sp.spmatrix | sp.sparray, x: Array, velocity: Array, time_step: float) -> None:
        if not time_step > 0:
            raise InputError("Inertia", "time_step", f"is {time_step}", "Give seconds above zero")
        self.mass = sp.csr_matrix(mass)
        self.time_step = time_step
        self._start = np.array(x, dtype=float)
        self._aim = self._start + time_step * np.asarray(velocity, dtype=float)
        self._hessian = sp.kron(self.mass, sp.eye(3), format="csr") / time_step**2
        self._hessian.sort_indices()

    def value(self, x: Array) -> float:
        """Energy in microjoules; zero at x0 + h v0."""
        ahead = x - self._aim
        return 0.5 * float(np.vdot(ahead, self.mass @ ahead)) / self.time_step**2

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: mass times the acceleration over the step."""
        return self.mass @ (x - self._aim) / self.time_step**2

    def force_sizes(self, x: Array) -> Array:
        """Size (n,) in mN of the force on each vertex."""
        return np.asarray(np.sqrt((self.gradient(x) ** 2).sum(axis=1)))

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm: M / h^2, positive definite, with or without `project`."""
        return self._hessian

    def velocity(self, x: Array) -> Array:
        """Velocities (n, 3) in mm/s after the step that ended at x."""
        return (x - self._start) / self.time_step

    def after(self, x: Array) -> Inertia:
        """The potential of the step that follows the one that ended at x."""
        return Inertia(self.mass, x, self.velocity(x), self.time_step)


def mass_matrix(vertices: Array, tets: IntArray, density: ArrayLike) -> sp.csr_matrix:
    """Consistent mass matrix of linear tets.

    Consistent, not lumped: kinetic energy is then that of the piecewise linear motion, exact for rigid
    motions too, and an implicit step gains nothing from a diagonal matrix. A tet of mass m has m/10 on the
    diagonal and m/20 off the diagonal.

    Parameters
    ----------
    vertices : array (n, 3)
        Rest positions in mm.
    tets : integer array (m, 4)
        Tets of the vertices.
    density : float or array (m,)
        Density in kg/mm^3, for soft tissue 1e-6. Multiply by the weights of `Elastic` where tissue fills only
        part of a tet.

    Returns
    -------
    sparse matrix (n, n)
        Masses in kg, the same for each coordinate.
    """
    corners = np.asarray(vertices)[tets]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    masses = volumes * np.broadcast_to(np.asarray(density, dtype=float), volumes.shape)
    blocks = masses[:, None, None] * (np.ones((4, 4)) + np.eye(4)) / 20
    rows, columns = np.repeat(tets, 4, axis=1).ravel(), np.tile(tets, (1, 4)).ravel()
    return sp.csr_matrix((blocks.ravel(), (rows, columns)), shape=(len(vertices), len(vertices)))
