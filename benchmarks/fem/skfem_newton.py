"""The reference: full Newton with scikit-fem's assembly and pypardiso, each used as it comes."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
import skfem
from skfem.helpers import ddot, det, grad, inv, transpose

from handpipe.core import Array, BoolArray, IntArray


def missing() -> str | None:
    """Why the reference cannot run, None where it can."""
    if importlib.util.find_spec("pypardiso") is None:
        return "pypardiso is not installed: make benchmark-setup"
    return None


@dataclass
class Solution:
    """Positions (n, 3), Newton steps, the final |g| of the free forces, and seconds by kind of work."""

    x: Array
    steps: int = 0
    residual: float = np.inf
    seconds: dict[str, float] = field(default_factory=lambda: {"assembly": 0.0, "linear": 0.0})


class NeoHookean:
    """Stable neo-Hookean of Smith et al. 2018 as scikit-fem forms, in their own parameters.

    psi = mu/2 (I - 3) + lambda/2 (J - alpha)^2 - mu/2 log(I + 1), with I = |F|^2. Derived apart from
    `handpipe.fem.elements.materials`, of which nothing is used here.
    """

    def __init__(self, young: float, poisson: float) -> None:
        lame_mu = young / (2 * (1 + poisson))
        lame_lambda = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
        self.mu = 4 / 3 * lame_mu
        self.lam = lame_lambda + 5 / 6 * lame_mu
        self.alpha = 1 + self.mu / self.lam - self.mu / (4 * self.lam)

    def stress(self, f: Array) -> Array:
        """First Piola stress (3, 3, m, q) of deformation gradients (3, 3, m, q)."""
        j, invariant = det(f), ddot(f, f)
        cofactor = j * transpose(inv(f))
        return self.mu * (1 - 1 / (invariant + 1)) * f + self.lam * (j - self.alpha) * cofactor

    def tangent(self, f: Array) -> Array:
        """Derivative (3, 3, 3, 3, m, q) of the stress."""
        j, invariant, inverse, identity = det(f), ddot(f, f), inv(f), np.eye(3)
        cofactor = j * transpose(inverse)
        out = np.einsum("ik,jl,...->ijkl...", identity, identity, self.mu * (1 - 1 / (invariant + 1)))
        out += np.einsum("ij...,kl...->ijkl...", 2 * self.mu / (invariant + 1) ** 2 * f, f)
        bulk = self.lam * (2 * j - self.alpha) / j
        out += np.einsum("ij...,kl...->ijkl...", bulk * cofactor, cofactor)
        turned = self.lam * (j - self.alpha) * j * inverse
        out -= np.einsum("li...,jk...->ijkl...", turned, inverse)
        return out


@skfem.LinearForm
def internal_force(v, w):  # type: ignore[no-untyped-def]
    return ddot(w.stress, grad(v))


def _stiffness(u, v, w):  # type: ignore[no-untyped-def]
    # Of the ways tried (closed form a pair, one einsum of three factors), this is the fastest.
    return ddot(np.einsum("ijkl...,kl...->ij...", w.tangent, grad(u)), grad(v))


class Reference:
    """Newton's method on one mesh: vertices (n, 3), tets (m, 4), `clamped` vertices (n,).

    `solve_linear` takes the place of `pypardiso.spsolve`.
    """

    def __init__(
        self,
        vertices: Array,
        tets: IntArray,
        clamped: BoolArray,
        material: NeoHookean,
        threads: int = 1,
        solve_linear: Callable[[sp.csr_matrix, Array], Array] | None = None,
    ) -> None:
        if solve_linear is None:
            import pypardiso

            solve_linear = pypardiso.spsolve
        self.solve_linear = solve_linear
        self.material = material
        self.vertices = vertices
        mesh = skfem.MeshTet(vertices.T.copy(), tets.T.copy())
        # Strains are constant in linear tets: one point of integration is exact.
        self.basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()), intorder=0)
        self.clamped = self.basis.nodal_dofs[:, clamped].T  # (k, 3)
        self.stiffness = skfem.BilinearForm(_stiffness, nthreads=threads)
        self.seconds = {"assembly": 0.0, "linear": 0.0}

    def forces(self, u: Array) -> tuple[Array, Array]:
        """Gradient of the energy (3n,) at displacements (3n,), and the deformation gradients."""
        f = grad(self.basis.interpolate(u)) + np.eye(3)[:, :, None, None]
        return internal_force.assemble(self.basis, stress=self.material.stress(f)), f

    def matrix(self, x: Array) -> sp.csr_matrix:
        """Stiffness at positions (n, 3), in the order of degrees of freedom 3 i + c."""
        f = self.forces(self._displacements(x))[1]
        assembled = self.stiffness.assemble(self.basis, tangent=self.material.tangent(f))
        order = self.basis.nodal_dofs.T.ravel()
        return assembled[order][:, order]

    def follow(self, targets: list[Array], tolerance: float, most: int = 30) -> Solution:
        """Newton to |g| < tolerance at each of the targets (n, 3) of the clamped vertices, one after another.

        A step begins with the tangent at hand: the first iteration condenses the clamped vertices' move.
        Raises `RuntimeError` where it does not converge in `most` iterations.
        """
        u = np.zeros(self.basis.N)
        found = Solution(self.vertices)
        self.seconds = found.seconds
        free = self.basis.complement_dofs(self.clamped.ravel())
        for target in targets:
            aim = self._displacements(target)
            for iteration in range(most + 1):
                begun = time.perf_counter()
                g, f = self.forces(u)
                moved = np.where(np.isin(np.arange(len(u)), free), 0.0, aim - u)
                found.residual = float(np.linalg.norm(g[free]))
                if found.residual < tolerance and not moved.any():
                    break
                if iteration == most:
                    raise RuntimeError(f"the reference stopped at |g| = {found.residual:.1e}")
                matrix = self.stiffness.assemble(self.basis, tangent=self.material.tangent(f))
                found.seconds["assembly"] += time.perf_counter() - begun
                u = u + skfem.solve(
                    *skfem.condense(matrix, -g, x=moved, D=self.clamped.ravel()), solver=self._timed
                )
                found.steps += 1
        found.x = self.vertices + u[self.basis.nodal_dofs].T
        return found

    def _displacements(self, x: Array) -> Array:
        u = np.zeros(self.basis.N)
        u[self.basis.nodal_dofs] = (x - self.vertices).T
        return u

    def _timed(self, matrix: sp.csr_matrix, b: Array) -> Array:
        begun = time.perf_counter()
        x = self.solve_linear(matrix, b)
        self.seconds["linear"] += time.perf_counter() - begun
        return x
