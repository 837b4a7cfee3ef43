"""Active stress of muscle: tension along its fibres, of one size at any length or by a force-length law."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import erf

from handpipe.core import Array, InputError
from handpipe.synthetic.continuum.density import DensityPotential
from handpipe.synthetic.continuum.elements import Elements

WIDTH = 0.45  # of the force-length law: at a stretch of 1 +- 0.45 fibres pull with 1/e of their force
BLUNT = 1e-3  # stretch at which the cone |F f| is rounded, so that crushed fibres have a direction


class ActiveFibres(DensityPotential):
    """Energy sum of V a sqrt(|F f|^2 + BLUNT^2): fibres pull with a force that does not depend on length.

    directions (m, 3) unit fibre directions f at rest of each cell; tension a in kPa of rest cross-section,
    one for all or one a cell. The first Piola stress is a n f^T with n the fibre's direction now.
    The energy is convex in F, hence the exact tangent is semidefinite already.
    """

    by_point = ("_directions", "_tension")

    def __init__(self, elements: Elements, directions: Array, tension: ArrayLike) -> None:
        super().__init__(elements)
        count, points = elements.volumes.shape
        lengths = np.linalg.norm(directions, axis=1)
        if directions.shape != (count, 3) or np.any(np.abs(lengths - 1) > 1e-6):
            problem = f"has shape {directions.shape} or vectors that are not of unit length"
            raise InputError("active fibres", "directions", problem, f"Give unit vectors ({count}, 3)")
        self._directions = np.repeat(directions, points, axis=0)
        self._set(tension)

    def with_tension(self, tension: ArrayLike) -> ActiveFibres:
        """The same fibres under another tension in kPa, one for all or one a cell."""
        other = copy.copy(self)
        other._set(tension)
        return other

    def _set(self, tension: ArrayLike) -> None:
        count, points = self.elements.volumes.shape
        given = np.broadcast_to(np.asarray(tension, dtype=float), (count,))
        if np.any(given < 0):
            raise InputError("active fibres", "tension", "is negative", "Fibres only pull: give zero or more")
        self._tension = np.repeat(given, points)

    def _fibres(self, f: Array, points: slice) -> tuple[Array, Array, Array, Array]:
        """Rest directions (p, 3), F f (p, 3), its rounded length (p,), tension (p,)."""
        rest = self._directions[points]
        now = np.einsum("pik,pk->pi", f, rest)
        return rest, now, np.sqrt((now**2).sum(axis=1) + BLUNT**2), self._tension[points]

    def stretches(self, x: Array) -> Array:
        """Stretch |F f| (m, q) of the fibres at every point."""
        f = self.deformation_gradients(x)
        now = np.einsum("pik,pk->pi", f.reshape(-1, 3, 3), self._directions)
        return np.linalg.norm(now, axis=1).reshape(f.shape[:2])

    def densities(self, f: Array, points: slice) -> Array:
        """Energy densities (p,) in kPa: tension times the rounded fibre stretch."""
        _, _, length, tension = self._fibres(f, points)
        return tension * length

    def stresses(self, f: Array, points: slice) -> Array:
        """First Piola stresses (p, 3, 3) in kPa: a n f^T."""
        rest, now, length, tension = self._fibres(f, points)
        return (tension / length)[:, None, None] * now[:, :, None] * rest[:, None, :]

    def tangents(self, f: Array, points: slice, project: bool) -> Array:
        """Derivatives (p, 9, 9) of the stresses by F in row-major order: semidefinite in either case."""
        rest, now, length, tension = self._fibres(f, points)
        n = now / length[:, None]
        across = (tension / length)[:, None, None] * (np.eye(3) - n[:, :, None] * n[:, None, :])
        return np.einsum("pij,pk,pl->pikjl", across, rest, rest).reshape(-1, 9, 9)


class HillFibres(ActiveFibres):
    """Energy sum of V a W(l) with W' = exp(-((l - 1) / WIDTH)^2): fibres pull most at their rest length.

    The active part of a muscle of Hill's type (Zajac 1989, fig. 2, as a Gaussian), without dependence on
    velocity: l is the rounded fibre stretch of `ActiveFibres`, tension a in kPa that at l = 1. Beyond l = 1
    the force falls with the length, and the exact tangent is not semidefinite.
    """

    def densities(self, f: Array, points: slice) -> Array:
        """Energy densities (p,) in kPa: the work of the force from the rest length."""
        _, _, length, tension = self._fibres(f, points)
        return np.asarray(tension * (0.5 * np.sqrt(np.pi) * WIDTH * erf((length - 1.0) / WIDTH)))

    def stresses(self, f: Array, points: slice) -> Array:
        """First Piola stresses (p, 3, 3) in kPa: a W'(l) n f^T."""
        rest, now, length, tension = self._fibres(f, points)
        force = tension * np.exp(-(((length - 1.0) / WIDTH) ** 2))
        return (force / length)[:, None, None] * now[:, :, None] * rest[:, None, :]

    def tangents(self, f: Array, points: slice, project: bool) -> Array:
        """Derivatives (p, 9, 9) of the stresses by F in row-major order; semidefinite with `project`."""
        rest, now, length, tension = self._fibres(f, points)
        force = tension * np.exp(-(((length - 1.0) / WIDTH) ** 2))
        slope = -2.0 * (length - 1.0) / WIDTH**2 * force
        if project:
            slope = np.maximum(slope, 0.0)
        n = now / length[:, None]
        along = n[:, :, None] * n[:, None, :]
        across = (force / length)[:, None, None] * (np.eye(3) - along)
        both = across + slope[:, None, None] * along
        return np.einsum("pij,pk,pl->pikjl", both, rest, rest).reshape(-1, 9, 9)
