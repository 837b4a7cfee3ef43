"""Equilibria of springs by one factor: a local-global step, and what earlier steps say about curvature."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, ConvergenceError, IntArray
from handpipe.fem.linear import Factor, factorise
from handpipe.levels.mass_spring.springs import Springs, forces

log = logging.getLogger(__name__)
MEMORY = 5  # earlier steps that are used
SUFFICIENT = 1e-4  # of the predicted decrease of energy
HALVINGS = 20  # of a step, at most


@dataclass(frozen=True, eq=False)
class Settled:
    """Nodes in equilibrium.

    Parameters
    ----------
    nodes : array (n, 3)
        Places, mm.
    residual : float
        How far the last step moved any node, mm.
    iterations : int
        Number of linear solves.
    energies : tuple of float
        Energy before each iteration, and at last; it never rises.
    """

    nodes: Array
    residual: float
    iterations: int
    energies: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class MassSpring:
    """Nodes on springs to one another and to targets.

    Parameters
    ----------
    springs : Springs
        Springs between nodes.
    holding : array (n,)
        Stiffness of springs without length from nodes to their targets, in the unit of the others.
    fixed : array (n,) of bool
        Nodes that lie on their targets.
    """

    springs: Springs
    holding: Array
    fixed: BoolArray

    @cached_property
    def free(self) -> IntArray:
        """Numbers of the nodes that move."""
        return np.flatnonzero(~self.fixed)

    @cached_property
    def factor(self) -> Factor:
        """Factor of the constant matrix of the global step, over the free nodes."""
        matrix = self.springs.laplacian(len(self.fixed)) + sparse.diags(self.holding)
        return factorise(matrix.tocsr()[self.free][:, self.free].tocsr())

    def _solve(self, slope: Array) -> Array:
        """The global step of a slope (f, 3), by column: Pardiso is faster so than with all at once."""
        return np.stack([self.factor.solve(np.ascontiguousarray(c)) for c in slope.T], axis=1)

    def settle(
        self, targets: Array, start: Array | None = None, tolerance: float = 0.1, most: int = 200
    ) -> Settled:
        """Static equilibrium with given targets: it depends on nothing before.

        A local-global step (projective dynamics) is the gradient through the constant factor. It always
        lowers the energy; the curvature of earlier steps (L-BFGS) makes it longer.

        Parameters
        ----------
        targets : array (n, 3)
            Where the springs without length pull the nodes, mm.
        start : array (n, 3), optional
            First guess, mm; by default the targets.
        tolerance : float
            The iteration ends with a step that moves no node farther, mm.
        most : int
            Largest number of iterations.

        Returns
        -------
        Settled
            Places of the nodes.

        Raises
        ------
        ConvergenceError
            If no step is as short.

        References
        ----------
        Bouaziz et al. 2014; Liu et al. 2017.
        """
        x = np.array(targets if start is None else start, dtype=np.float64)
        x[self.fixed] = targets[self.fixed]
        gradient = np.empty_like(x)

        def measure(at: Array) -> tuple[float, Array]:
            energy = forces(at, self.springs, targets, self.holding, gradient)
            return energy, gradient[self.free]

        energy, slope = measure(x)
        energies, known = [energy], _Steps(self._solve)
        for iteration in range(1, most + 1):
            found = self._shorter(x, known.direction(slope), (energy, slope), measure)
            if found is None:
                known.kept.clear()
                found = self._shorter(x, known.direction(slope), (energy, slope), measure)
            if found is None:  # as low as rounding lets it be
                return Settled(x, 0.0, iteration, tuple(energies))
            step, energy, after = found
            x[self.free] += step
            energies.append(energy)
            residual = float(np.sqrt((step**2).sum(axis=1).max(initial=0.0)))
            if residual <= tolerance:
                return Settled(x, residual, iteration, tuple(energies))
            known.add(step, after - slope)
            slope = after
        reason = f"after {most} iterations a step still moves a node by {residual:.3f} mm"
        raise ConvergenceError("springs", f"{reason}, of which {tolerance} mm are allowed")

    def _shorter(
        self,
        x: Array,
        direction: Array,
        here: tuple[float, Array],
        measure: Callable[[Array], tuple[float, Array]],
    ) -> tuple[Array, float, Array] | None:
        """Step along a direction that lowers the energy enough, the energy there, and its slope."""
        energy, slope = here
        falls, tried = float((direction * slope).sum()), x.copy()
        if falls >= 0:
            return None
        for halving in range(HALVINGS):
            step = 0.5**halving * direction
            tried[self.free] = x[self.free] + step
            after, gradient = measure(tried)
            if after <= energy + SUFFICIENT * 0.5**halving * falls:
                return step, after, gradient
        return None


class _Steps:
    """Earlier steps, by which the inverse of the constant matrix becomes that of the energy's curvature."""

    def __init__(self, solve: Callable[[Array], Array]) -> None:
        self.solve = solve
        self.kept: list[tuple[Array, Array, float]] = []

    def add(self, step: Array, change: Array) -> None:
        """Keep a step and the change of the slope along it, where the energy is convex."""
        curvature = float((step * change).sum())
        if curvature > 1e-12 * float((change * change).sum()):
            self.kept = [*self.kept[1 - MEMORY :], (step, change, curvature)]

    def direction(self, slope: Array) -> Array:
        """Direction of descent; without earlier steps the local-global one."""
        left, shares = slope.copy(), []
        for step, change, curvature in reversed(self.kept):
            share = float((step * left).sum()) / curvature
            left -= share * change
            shares.append(share)
        found = self.solve(left)
        for (step, change, curvature), share in zip(self.kept, reversed(shares), strict=True):
            found += (share - float((change * found).sum()) / curvature) * step
        return -found
