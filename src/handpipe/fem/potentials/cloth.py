"""Membranes: triangle meshes that resist stretch, with a rest shape that may be smaller than the mesh."""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit

from handpipe.core import Array, BoolArray, InputError, Int32Array, IntArray
from handpipe.fem.elements.materials import Material
from handpipe.fem.patterns.assembly import Pattern


class _Sheet(NamedTuple):
    """Triangles (k, 3), gradients of shape functions (k, 3, 2), factors of energy (k,) and moduli (k,)."""

    triangles: IntArray
    gradients: Array
    energies: Array
    mu: Array
    lam: Array


class Membrane:
    """St. Venant-Kirchhoff membrane in plane stress: energy h A0 (mu |E|^2 + l/2 tr(E)^2).

    l = 2 mu lambda / (lambda + 2 mu), with rest areas A0 and thickness h.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm of the mesh, before its rest shape is scaled.
    triangles : integer array (k, 3)
        Triangles of the vertices.
    material : Material
        Moduli of all triangles or one a triangle; only the Lame parameters count, not the model.
    thickness : float
        Thickness h in mm.
    scale : float
        Size of the rest shape relative to the mesh. Zheng 2022 uses 0.35 to 0.40, so that the cloth is in
        tension everywhere, where its energy is convex.

    Raises
    ------
    InputError
        If a triangle has no area.

    References
    ----------
    Zheng 2022 §6.
    """

    def __init__(
        self, vertices: Array, triangles: IntArray, material: Material, thickness: float, scale: float = 1.0
    ) -> None:
        self.triangles = np.ascontiguousarray(triangles, dtype=np.int64)
        self.pattern, self._count = Pattern.of_cells(self.triangles, len(vertices)), len(vertices)
        mu, lam = material.lame(len(triangles))
        gradients, areas = membrane_gradients(vertices, self.triangles, scale)
        lam = 2 * mu * lam / (lam + 2 * mu)
        self._sheet = _Sheet(self.triangles, gradients, thickness * areas, mu.copy(), lam)

    def near(self, moving: BoolArray, kept: IntArray) -> Membrane:
        """The energy of the triangles that have a vertex of a mask (n,), as `Sum.near` says."""
        mine = moving[self.triangles].any(axis=1)
        other = copy.copy(self)
        other.triangles, other._count = np.searchsorted(kept, self.triangles[mine]), len(kept)
        other.pattern = Pattern.of_cells(other.triangles, len(kept))
        other._sheet = _Sheet(other.triangles, *(values[mine] for values in self._sheet[1:]))
        return other

    def value(self, x: Array) -> float:
        """Energy in microjoules, summed over triangles."""
        return _value(x, self._sheet)

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force."""
        return _gradient(x, self._sheet)

    def force_sizes(self, x: Array) -> Array:
        """Sum (n,) of the sizes in mN of the forces that triangles put on each vertex."""
        out = np.zeros(len(x))
        _add_force_sizes(x, self._sheet, out)
        return out

    def resistance(self) -> Array:
        """Force (n,) in mN on each vertex with which its triangles resist a shear strain of one, at rest."""
        sizes = np.sqrt((self._sheet.gradients**2).sum(axis=2))
        forces = 2.0 * (self._sheet.energies * self._sheet.mu)[:, None] * sizes
        return np.asarray(np.bincount(self.triangles.ravel(), forces.ravel(), self._count), dtype=float)

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Exact second derivative (3n, 3n) in mN/mm; `project` drops compressive stresses."""
        data = self.pattern.data()
        slots, strides = self.pattern.slots, self.pattern.strides
        _hessian(x, self._sheet, project, slots, strides, data)
        return self.pattern.matrix(data)

    def stretches(self, x: Array) -> Array:
        """Principal stretches (k, 2), ascending, from the scaled rest shape; above 1 is tension."""
        f = np.einsum("eai,eak->eik", x[self.triangles], self._sheet.gradients)
        return np.sqrt(np.linalg.eigvalsh(np.einsum("eik,eil->ekl", f, f)))


def membrane_gradients(vertices: Array, triangles: IntArray, scale: float) -> tuple[Array, Array]:
    """Gradients (k, 3, 2) of the linear shape functions in each triangle's plane, and rest areas (k,)."""
    a, b, c = (vertices[triangles[:, i]] * scale for i in range(3))
    along = np.linalg.norm(b - a, axis=1)
    normal = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    if not np.all(normal > 0):
        problem = f"triangle {int(np.argmin(normal))} has no area"
        raise InputError("membrane", "triangles", problem, "Remesh the surface")
    rest = np.zeros((len(triangles), 2, 2))
    rest[:, 0, 0] = along
    rest[:, 0, 1] = np.einsum("ij,ij->i", b - a, c - a) / along
    rest[:, 1, 1] = normal / along
    inverses = np.linalg.inv(rest)
    return np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1), 0.5 * normal


@njit(cache=True)
def _state(x: Array, triangle: IntArray, b: Array, mu: float, lam: float, f: Array, s: Array) -> float:
    """Fill F (3, 2) and the second Piola stress (2, 2); return the energy density."""
    for i in range(3):
        for k in range(2):
            f[i, k] = sum_of_three(x[triangle[0], i], x[triangle[1], i], x[triangle[2], i], b, k)
    e00 = 0.5 * (f[0, 0] ** 2 + f[1, 0] ** 2 + f[2, 0] ** 2 - 1.0)
    e11 = 0.5 * (f[0, 1] ** 2 + f[1, 1] ** 2 + f[2, 1] ** 2 - 1.0)
    e01 = 0.5 * (f[0, 0] * f[0, 1] + f[1, 0] * f[1, 1] + f[2, 0] * f[2, 1])
    trace = e00 + e11
    s[0, 0] = 2.0 * mu * e00 + lam * trace
    s[1, 1] = 2.0 * mu * e11 + lam * trace
    s[0, 1] = s[1, 0] = 2.0 * mu * e01
    return mu * (e00**2 + e11**2 + 2.0 * e01**2) + 0.5 * lam * trace**2


@njit(cache=True, inline="always")
def sum_of_three(x0: float, x1: float, x2: float, b: Array, k: int) -> float:
    """One entry of F from a coordinate of the three corners."""
    return x0 * b[0, k] + x1 * b[1, k] + x2 * b[2, k]


@njit(cache=True)
def _value(x: Array, sheet: _Sheet) -> float:
    triangles, gradients, energies, mu, lam = sheet
    f, s = np.empty((3, 2)), np.empty((2, 2))
    total = 0.0
    for e in range(len(triangles)):
        total += energies[e] * _state(x, triangles[e], gradients[e], mu[e], lam[e], f, s)
    return total


@njit(cache=True)
def _gradient(x: Array, sheet: _Sheet) -> Array:
    out = np.zeros_like(x)
    triangles, gradients, energies, mu, lam = sheet
    f, s = np.empty((3, 2)), np.empty((2, 2))
    for e in range(len(triangles)):
        b = gradients[e]
        _state(x, triangles[e], b, mu[e], lam[e], f, s)
        for a in range(3):
            t0 = s[0, 0] * b[a, 0] + s[0, 1] * b[a, 1]
            t1 = s[1, 0] * b[a, 0] + s[1, 1] * b[a, 1]
            for i in range(3):
                out[triangles[e, a], i] += energies[e] * (f[i, 0] * t0 + f[i, 1] * t1)
    return out


@njit(cache=True)
def _add_force_sizes(x: Array, sheet: _Sheet, out: Array) -> None:
    triangles, gradients, energies, mu, lam = sheet
    f, s = np.empty((3, 2)), np.empty((2, 2))
    for e in range(len(triangles)):
        b = gradients[e]
        _state(x, triangles[e], b, mu[e], lam[e], f, s)
        for a in range(3):
            t0 = s[0, 0] * b[a, 0] + s[0, 1] * b[a, 1]
            t1 = s[1, 0] * b[a, 0] + s[1, 1] * b[a, 1]
            squared = 0.0
            for i in range(3):
                squared += (f[i, 0] * t0 + f[i, 1] * t1) ** 2
            out[triangles[e, a]] += energies[e] * np.sqrt(squared)


@njit(cache=True)
def _hessian(
    x: Array,
    sheet: _Sheet,
    project: bool,
    slots: Int32Array,
    strides: Int32Array,
    data: Array,
) -> None:
    triangles, gradients, energies, mu, lam = sheet
    f, s, fb = np.empty((3, 2)), np.empty((2, 2)), np.empty((3, 3))
    for e in range(len(triangles)):
        b, m = gradients[e], mu[e]
        _state(x, triangles[e], b, m, lam[e], f, s)
        if project:
            _positive_part(s)
        for a in range(3):
            for i in range(3):
                fb[a, i] = f[i, 0] * b[a, 0] + f[i, 1] * b[a, 1]
        for a in range(3):
            stride = strides[triangles[e, a]]
            for c in range(3):
                start = slots[9 * e + 3 * a + c]
                geometric = 0.0
                metric = b[a, 0] * b[c, 0] + b[a, 1] * b[c, 1]
                for k in range(2):
                    geometric += b[a, k] * (s[k, 0] * b[c, 0] + s[k, 1] * b[c, 1])
                for i in range(3):
                    for j in range(3):
                        outer = f[i, 0] * f[j, 0] + f[i, 1] * f[j, 1]
                        h = m * (metric * outer + fb[c, i] * fb[a, j]) + lam[e] * fb[a, i] * fb[c, j]
                        if i == j:
                            h += geometric
                        data[start + i * stride + j] += energies[e] * h


@njit(cache=True)
def _positive_part(s: Array) -> None:
    """Drop the compressive part of a stress (2, 2); the rest of the Hessian is semidefinite as it is."""
    mean, half = 0.5 * (s[0, 0] + s[1, 1]), 0.5 * (s[0, 0] - s[1, 1])
    radius = np.sqrt(half**2 + s[0, 1] ** 2)
    high, low = max(mean + radius, 0.0), max(mean - radius, 0.0)
    if radius == 0.0:
        s[0, 0] = s[1, 1] = high
        s[0, 1] = s[1, 0] = 0.0
        return
    slope, base = (high - low) / (2.0 * radius), 0.5 * (high + low)
    s[0, 0], s[1, 1] = base + slope * half, base - slope * half
    s[0, 1] = s[1, 0] = slope * s[0, 1]
