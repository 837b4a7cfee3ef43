"""Potentials that are integrals over elements of a density of the deformation gradient."""

from __future__ import annotations

import copy
from typing import ClassVar, Self

import numpy as np
import scipy.sparse as sp
from numba import njit

from handpipe.core import Array, BoolArray, Int32Array, IntArray
from handpipe.synthetic.continuum.elements import Elements

CHUNK = 2_000  # cells whose (9, 9) tangents are in memory at a time


class DensityPotential:
    """Energy sum over points of V psi(F), in microjoules.

    A subclass gives `densities`, `stresses` and `tangents` of deformation gradients (p, 3, 3) at the points
    of a slice of all points, which are numbered by cells, and names the attributes that have a row a point.
    """

    by_point: ClassVar[tuple[str, ...]] = ()

    def __init__(self, elements: Elements) -> None:
        self.elements = elements
        self.vertices = elements.nodes
        self._points = elements.volumes.shape[1]

    def about(self, moving: BoolArray, nodes: BoolArray) -> Self:
        """The energy of the cells that have one of the nodes `moving` (n,), of the positions of `nodes` (n,).

        Of the whole body's nodes (n,); `nodes` are to have all of these cells'.
        """
        cells = self.elements.touching(moving)
        other = copy.copy(self)
        DensityPotential.__init__(other, self.elements.among(cells, nodes))
        for name in self.by_point:
            setattr(other, name, getattr(self, name)[np.repeat(cells, self._points)])
        return other

    def densities(self, f: Array, points: slice) -> Array:
        """Energy densities (p,) in kPa."""
        raise NotImplementedError

    def stresses(self, f: Array, points: slice) -> Array:
        """First Piola stresses (p, 3, 3) in kPa."""
        raise NotImplementedError

    def tangents(self, f: Array, points: slice, project: bool) -> Array:
        """Derivatives (p, 9, 9) of the stresses by F in row-major order; semidefinite with `project`."""
        raise NotImplementedError

    def deformation_gradients(self, x: Array) -> Array:
        """F (m, q, 3, 3) at every cell's points."""
        return _deformation_gradients(np.ascontiguousarray(x), self.elements.cells, self.elements.gradients)

    def value(self, x: Array) -> float:
        """Energy in microjoules, summed over points."""
        f = self.deformation_gradients(x).reshape(-1, 3, 3)
        return float(self.elements.volumes.ravel() @ self.densities(f, slice(None)))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force."""
        e = self.elements
        f = self.deformation_gradients(x)
        stress = self.stresses(f.reshape(-1, 3, 3), slice(None)).reshape(f.shape)
        out = np.zeros_like(x)
        _add_forces(e.cells, e.gradients, e.volumes, stress, out)
        return out

    def force_sizes(self, x: Array) -> Array:
        """Sum (n,) of the sizes in mN of the forces that cells put on each node."""
        e = self.elements
        f = self.deformation_gradients(x)
        stress = self.stresses(f.reshape(-1, 3, 3), slice(None)).reshape(f.shape)
        out = np.zeros(len(x))
        _add_force_sizes(e.cells, e.gradients, e.volumes, stress, out)
        return out

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n) in mN/mm; with `project`, made semidefinite point by point."""
        e, pattern = self.elements, self.elements.pattern
        data = pattern.data()
        f = self.deformation_gradients(x)
        for first in range(0, len(e.cells), CHUNK):
            last = min(first + CHUNK, len(e.cells))
            points = slice(first * self._points, last * self._points)
            tangent = self.tangents(f[first:last].reshape(-1, 3, 3), points, project)
            add_stiffness(e, np.arange(first, last), tangent, data)
        return pattern.matrix(data)


def add_stiffness(elements: Elements, cells: IntArray, tangents: Array, data: Array) -> None:
    """Add sum_q V_q G^T C G of some cells (c,) to the data of the elements' pattern; tangents (c q, 9, 9)."""
    e, pattern = elements, elements.pattern
    tangents = tangents.reshape(len(cells), e.volumes.shape[1], 9, 9)
    _add_stiffness(cells, (e.cells, e.gradients, e.volumes), tangents, pattern.slots, pattern.strides, data)


def semidefinite(tangents: Array) -> Array:
    """Symmetric matrices (p, 9, 9) without the parts of negative eigenvalues."""
    values, vectors = np.linalg.eigh(tangents)
    return (vectors * np.maximum(values, 0.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)


@njit(cache=True)
def _deformation_gradients(x: Array, cells: IntArray, gradients: Array) -> Array:
    count, points, nodes = gradients.shape[:3]
    out = np.zeros((count, points, 3, 3))
    for e in range(count):
        for q in range(points):
            for a in range(nodes):
                for i in range(3):
                    for k in range(3):
                        out[e, q, i, k] += x[cells[e, a], i] * gradients[e, q, a, k]
    return out


@njit(cache=True)
def _add_forces(cells: IntArray, gradients: Array, volumes: Array, stress: Array, out: Array) -> None:
    count, points, nodes = gradients.shape[:3]
    for e in range(count):
        for q in range(points):
            for a in range(nodes):
                for i in range(3):
                    force = 0.0
                    for k in range(3):
                        force += stress[e, q, i, k] * gradients[e, q, a, k]
                    out[cells[e, a], i] += volumes[e, q] * force


@njit(cache=True)
def _add_force_sizes(cells: IntArray, gradients: Array, volumes: Array, stress: Array, out: Array) -> None:
    count, points, nodes = gradients.shape[:3]
    for e in range(count):
        for a in range(nodes):
            squared = 0.0
            for i in range(3):
                force = 0.0
                for q in range(points):
                    for k in range(3):
                        force += volumes[e, q] * stress[e, q, i, k] * gradients[e, q, a, k]
                squared += force**2
            out[cells[e, a]] += np.sqrt(squared)


@njit(cache=True)
def _add_stiffness(
    which: IntArray,
    elements: tuple[IntArray, Array, Array],
    tangent: Array,
    slots: Int32Array,
    strides: Int32Array,
    data: Array,
) -> None:
    """Of a cell only the pairs of nodes b >= a are computed; elements: all cells, gradients and volumes."""
    cells, gradients, volumes = elements
    points, nodes = gradients.shape[1:3]
    blocks = np.empty((nodes, nodes, 3, 3))
    half = np.empty((3, 3, 3))
    for number, e in enumerate(which):
        blocks[:] = 0.0
        for q in range(points):
            c, g, volume = tangent[number, q], gradients[e, q], volumes[e, q]
            for a in range(nodes):
                for i in range(3):
                    for j in range(3):
                        for m in range(3):
                            half[i, j, m] = volume * (
                                g[a, 0] * c[3 * i, 3 * j + m]
                                + g[a, 1] * c[3 * i + 1, 3 * j + m]
                                + g[a, 2] * c[3 * i + 2, 3 * j + m]
                            )
                for b in range(a, nodes):
                    for i in range(3):
                        for j in range(3):
                            blocks[a, b, i, j] += (
                                half[i, j, 0] * g[b, 0] + half[i, j, 1] * g[b, 1] + half[i, j, 2] * g[b, 2]
                            )
        for a in range(nodes):
            stride = strides[cells[e, a]]
            for b in range(nodes):
                at = slots[(e * nodes + a) * nodes + b]
                for i in range(3):
                    for j in range(3):
                        entry = blocks[a, b, i, j] if b >= a else blocks[b, a, j, i]
                        data[at + i * stride + j] += entry
