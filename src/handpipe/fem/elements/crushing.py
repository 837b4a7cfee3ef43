"""A barrier against inversion of tets, at which the energy of a stable law is finite."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, IntArray
from handpipe.fem.elements.tet_kernels import ElementArrays, volume_ratios
from handpipe.fem.patterns.assembly import Pattern

CRUSHED = 0.1  # of its volume at rest: where the barrier begins
STEEPEST = 1e-3  # of that: below, the barrier is quadratic, so that an inverted start has an energy
PERMUTATION = np.zeros((3, 3, 3))
PERMUTATION[[0, 1, 2], [1, 2, 0], [2, 0, 1]], PERMUTATION[[0, 2, 1], [2, 1, 0], [1, 0, 2]] = 1.0, -1.0


class Crushing:
    """Energy sum of w V0 |Fp| k b(J / 0.1) over tets with J = det(F Fp^-1) < 0.1, in microjoules.

    b(s) = -(s - 1)^2 ln s, and k is the body's own bulk modulus. Below s = `steepest` b continues as its
    parabola there: twice continuous, and finite at inverted positions. With a smaller `steepest` the same
    force leaves more volume; a large one lets inverted tets turn over.
    """

    def __init__(self, body: ElementArrays, pattern: Pattern, steepest: float = STEEPEST) -> None:
        self._body, self._pattern, self.steepest = body, pattern, steepest
        self._stiffness = body.weights * (body.lam + 5.0 / 6.0 * body.mu)

    def value(self, x: Array) -> float:
        """Energy in microjoules; zero where every tet has a tenth of its volume or more."""
        cells, shares = self._crushed(x)
        return float(self._stiffness[cells] @ barrier(shares, self.steepest)[0])

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force."""
        cells, shares = self._crushed(x)
        slope = self._stiffness[cells] * barrier(shares, self.steepest)[1] / CRUSHED
        g = self._body.gradients[cells]
        forces = slope[:, None, None] * np.einsum("mik,mak->mai", cofactors(self._gradients(x, cells)), g)
        out = np.zeros_like(x)
        np.add.at(out, self._body.tets[cells], forces)
        return out

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Exact second derivative (3n, 3n) in mN/mm; with `project`, made semidefinite tet by tet."""
        cells, shares = self._crushed(x)
        _, first, second = barrier(shares, self.steepest)
        f, stiffness = self._gradients(x, cells), self._stiffness[cells]
        normal = cofactors(f).reshape(-1, 9)
        curvature, slope = stiffness * second / CRUSHED**2, stiffness * first / CRUSHED
        tangents = curvature[:, None, None] * normal[:, :, None] * normal[:, None, :]
        twist = np.einsum("ijm,kln,pmn->pikjl", PERMUTATION, PERMUTATION, f).reshape(-1, 9, 9)
        tangents += slope[:, None, None] * twist
        if project:
            values, vectors = np.linalg.eigh(tangents)
            tangents = np.einsum("mik,mk,mjk->mij", vectors, np.maximum(values, 0.0), vectors)
        g = self._body.gradients[cells]
        blocks = np.einsum("mak,mikjl,mbl->mabij", g, tangents.reshape(-1, 3, 3, 3, 3), g, optimize=True)
        return self._pattern.matrix(self._scattered(cells, blocks))

    def _crushed(self, x: Array) -> tuple[IntArray, Array]:
        """The tets with less than `CRUSHED` of their volume, and how much of that each has."""
        ratios = volume_ratios(np.ascontiguousarray(x), self._body)
        cells = np.flatnonzero(ratios < CRUSHED)
        return cells, ratios[cells] / CRUSHED

    def _gradients(self, x: Array, cells: IntArray) -> Array:
        """F Fp^-1 (k, 3, 3) of some tets."""
        return np.einsum("mai,mak->mik", x[self._body.tets[cells]], self._body.gradients[cells])

    def _scattered(self, cells: IntArray, blocks: Array) -> Array:
        """Values of the Hessian in the order of the pattern, from blocks (k, 4, 4, 3, 3)."""
        data, tets = self._pattern.data(), self._body.tets[cells]
        slots = self._pattern.slots.reshape(-1, 4, 4)[cells].astype(np.int64)
        strides = self._pattern.strides[tets].astype(np.int64)
        axes = np.arange(3)
        places = slots[..., None, None] + strides[:, :, None, None, None] * axes[:, None] + axes
        np.add.at(data, places, blocks)
        return data


def barrier(shares: Array, steepest: float) -> tuple[Array, Array, Array]:
    """b(s) for shares s < 1 and its first and second derivative, each (k,)."""
    at = np.maximum(shares, steepest)
    log, gap, beyond = np.log(at), at - 1.0, shares - at
    value = -(gap**2) * log
    first = -2 * gap * log - gap**2 / at
    second = -2 * log - 4 * gap / at + gap**2 / at**2
    value += beyond * (first + 0.5 * beyond * second)
    return value, first + beyond * second, second


def cofactors(f: Array) -> Array:
    """Derivatives (k, 3, 3) of det F, of F (k, 3, 3)."""
    return np.stack([np.cross(f[:, 1], f[:, 2]), np.cross(f[:, 2], f[:, 0]), np.cross(f[:, 0], f[:, 1])], 1)
