"""Energy, forces and stiffness of linear tets, compiled, on as many threads as the partition has parts.

Stiffness is assembled without the (9, 9) derivative of the stress: a pair of vertices with shape gradients g
and h couples through the vectors F g, cof(F) g, F (g x h) and a few scalars alone. Since shape gradients sum
to zero, the blocks of three vertices give the rest.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, prange

from handpipe.core import Array, Int32Array, IntArray
from handpipe.fem.elements.materials import (
    NEO_HOOKEAN,
    energy_density,
    piola,
    projected_eigensystem,
    rest_stable,
)
from handpipe.fem.elements.matrix3 import cofactor, determinant, rotational_svd
from handpipe.fem.patterns.assembly import Pattern
from handpipe.fem.patterns.partition import Partition, PartitionArrays


class ElementArrays(NamedTuple):
    """Tets (m, 4), shape gradients (m, 4, 3), volumes or other factors of energy (m,), material."""

    tets: IntArray
    gradients: Array
    weights: Array
    model: int
    mu: Array
    lam: Array


class Law(NamedTuple):
    """One tet's material, with its Lame parameters in kPa."""

    model: int
    mu: float
    lam: float


class Slots(NamedTuple):
    """Where element blocks stand in CSR values, see `Pattern`."""

    indptr: Int32Array
    slots: Int32Array
    strides: Int32Array


@njit(cache=True, inline="always")
def gather(x: Array, tet: IntArray, gradients: Array, f: Array) -> None:
    """Deformation gradient (3, 3) of a tet (4,) with shape gradients (4, 3)."""
    for i in range(3):
        x0, x1, x2, x3 = x[tet[0], i], x[tet[1], i], x[tet[2], i], x[tet[3], i]
        for k in range(3):
            f[i, k] = (
                x0 * gradients[0, k] + x1 * gradients[1, k] + x2 * gradients[2, k] + x3 * gradients[3, k]
            )


@njit(cache=True)
def _energies(x: Array, body: ElementArrays, first: int, last: int, out: Array) -> None:
    f = np.empty((3, 3))
    for e in range(first, last):
        gather(x, body.tets[e], body.gradients[e], f)
        out[e] = body.weights[e] * energy_density(body.model, f, body.mu[e], body.lam[e])


@njit(cache=True)
def volume_ratios(x: Array, body: ElementArrays) -> Array:
    """Determinants (m,) of the deformation gradients."""
    out, f = np.empty(len(body.tets)), np.empty((3, 3))
    for e in range(len(out)):
        gather(x, body.tets[e], body.gradients[e], f)
        out[e] = determinant(f)
    return out


@njit(cache=True)
def _forces(x: Array, body: ElementArrays, share: PartitionArrays, part: int, out: Array) -> None:
    f, p = np.empty((3, 3)), np.empty((3, 3))
    for v in share.vertices[share.vertex_starts[part] : share.vertex_starts[part + 1]]:
        for i in range(3):
            out[v, i] = 0.0
    for e in share.cells[share.cell_starts[part] : share.cell_starts[part + 1]]:
        g, weight = body.gradients[e], body.weights[e]
        gather(x, body.tets[e], g, f)
        piola(body.model, f, body.mu[e], body.lam[e], p)
        for a in range(4):
            v = body.tets[e, a]
            if share.owner[v] == part:
                for i in range(3):
                    out[v, i] += weight * (p[i, 0] * g[a, 0] + p[i, 1] * g[a, 1] + p[i, 2] * g[a, 2])


@njit(cache=True)
def force_sizes(x: Array, body: ElementArrays, out: Array) -> None:
    """Add the sizes of the forces that each tet puts on its corners to out (n,)."""
    f, p = np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(body.tets)):
        g = body.gradients[e]
        gather(x, body.tets[e], g, f)
        piola(body.model, f, body.mu[e], body.lam[e], p)
        for a in range(4):
            squared = 0.0
            for i in range(3):
                squared += (p[i, 0] * g[a, 0] + p[i, 1] * g[a, 1] + p[i, 2] * g[a, 2]) ** 2
            out[body.tets[e, a]] += body.weights[e] * np.sqrt(squared)


@njit(cache=True)
def _stiffness(
    x: Array, body: ElementArrays, share: PartitionArrays, slots: Slots, part: int, project: bool, data: Array
) -> None:
    f, blocks, work = np.empty((3, 3)), np.empty((4, 4, 3, 3)), np.empty((12, 3, 3))
    for v in share.vertices[share.vertex_starts[part] : share.vertex_starts[part + 1]]:
        for at in range(slots.indptr[3 * v], slots.indptr[3 * v + 3]):
            data[at] = 0.0
    for e in share.cells[share.cell_starts[part] : share.cell_starts[part + 1]]:
        g, law = body.gradients[e], Law(body.model, body.mu[e], body.lam[e])
        gather(x, body.tets[e], g, f)
        if project:
            projected_blocks(law, f, g, body.weights[e], work, blocks)
        else:
            plain_blocks(law, f, g, body.weights[e], work, blocks)
        complete(blocks)
        for a in range(4):
            v = body.tets[e, a]
            if share.owner[v] != part:
                continue
            stride = slots.strides[v]
            for b in range(4):
                at = slots.slots[16 * e + 4 * a + b]
                for i in range(3):
                    for j in range(3):
                        data[at + i * stride + j] += blocks[a, b, i, j]


@njit(cache=True, inline="always")
def complete(blocks: Array) -> None:
    """All blocks (4, 4, 3, 3) from those of vertices 1 to 3 with b >= a: symmetry, and rows sum to zero."""
    for i in range(3):
        for j in range(3):
            blocks[2, 1, i, j] = blocks[1, 2, j, i]
            blocks[3, 1, i, j] = blocks[1, 3, j, i]
            blocks[3, 2, i, j] = blocks[2, 3, j, i]
    for a in range(1, 4):
        for i in range(3):
            for j in range(3):
                s = -(blocks[a, 1, i, j] + blocks[a, 2, i, j] + blocks[a, 3, i, j])
                blocks[a, 0, i, j] = s
                blocks[0, a, j, i] = s
    for i in range(3):
        for j in range(3):
            blocks[0, 0, i, j] = -(blocks[0, 1, i, j] + blocks[0, 2, i, j] + blocks[0, 3, i, j])


@njit(cache=True)
def plain_blocks(law: Law, f: Array, g: Array, weight: float, work: Array, blocks: Array) -> None:
    """Blocks of vertices 1 to 3, b >= a, of the exact stiffness times `weight`; `work` is (4, 3, 3) or more.

    With shape gradients g, h: alpha 1 + c (F g)(F h)^T + l (C g)(C h)^T + p [F (g x h)], where C = cof F, p =
    d psi / dJ, and [w] is the matrix e_ijm w_m; StVK adds mu (g . h) F F^T + mu (F h)(F g)^T.
    """
    model, mu, lam = law
    fg, cg, c, s = work[0], work[1], work[2], work[3]
    cofactor(f, c)
    volume = determinant(f) - 1.0
    neo = model == NEO_HOOKEAN
    squares = 0.0
    for i in range(3):
        for k in range(3):
            squares += f[i, k] * f[i, k]
            fg[i, k] = f[k, 0] * g[i + 1, 0] + f[k, 1] * g[i + 1, 1] + f[k, 2] * g[i + 1, 2]
            cg[i, k] = c[k, 0] * g[i + 1, 0] + c[k, 1] * g[i + 1, 1] + c[k, 2] * g[i + 1, 2]
    if neo:
        m, bulk = rest_stable(mu, lam)
        inverse = 1.0 / (squares + 1.0)
        shear = weight * m * (1.0 - inverse)
        pressure = weight * (bulk * volume - 0.75 * m)
        coupling, bulk = 2.0 * weight * m * inverse * inverse, weight * bulk
    else:
        shear, pressure, coupling, bulk = 0.0, weight * lam * volume, weight * lam, weight * lam
        _second_piola(f, weight * mu, weight * lam * 0.5 * (squares - 3.0), s)
    for a in range(3):
        for b in range(a, 3):
            alpha = 0.0
            for k in range(3):
                alpha += g[a + 1, k] * g[b + 1, k]
            dot = weight * mu * alpha
            alpha *= shear
            if not neo:
                for k in range(3):
                    alpha += g[a + 1, k] * (
                        s[k, 0] * g[b + 1, 0] + s[k, 1] * g[b + 1, 1] + s[k, 2] * g[b + 1, 2]
                    )
            for i in range(3):
                left, right = coupling * fg[a, i], bulk * cg[a, i]
                for j in range(3):
                    blocks[a + 1, b + 1, i, j] = left * fg[b, j] + right * cg[b, j]
                    if not neo:
                        outer = f[i, 0] * f[j, 0] + f[i, 1] * f[j, 1] + f[i, 2] * f[j, 2]
                        blocks[a + 1, b + 1, i, j] += dot * outer + weight * mu * fg[b, i] * fg[a, j]
                blocks[a + 1, b + 1, i, i] += alpha
            if a != b:
                nx = pressure * (g[a + 1, 1] * g[b + 1, 2] - g[a + 1, 2] * g[b + 1, 1])
                ny = pressure * (g[a + 1, 2] * g[b + 1, 0] - g[a + 1, 0] * g[b + 1, 2])
                nz = pressure * (g[a + 1, 0] * g[b + 1, 1] - g[a + 1, 1] * g[b + 1, 0])
                wx = f[0, 0] * nx + f[0, 1] * ny + f[0, 2] * nz
                wy = f[1, 0] * nx + f[1, 1] * ny + f[1, 2] * nz
                wz = f[2, 0] * nx + f[2, 1] * ny + f[2, 2] * nz
                blocks[a + 1, b + 1, 0, 1] += wz
                blocks[a + 1, b + 1, 1, 0] -= wz
                blocks[a + 1, b + 1, 0, 2] -= wy
                blocks[a + 1, b + 1, 2, 0] += wy
                blocks[a + 1, b + 1, 1, 2] += wx
                blocks[a + 1, b + 1, 2, 1] -= wx


@njit(cache=True)
def _second_piola(f: Array, mu: float, dilation: float, out: Array) -> None:
    for i in range(3):
        for k in range(3):
            out[i, k] = mu * (f[0, i] * f[0, k] + f[1, i] * f[1, k] + f[2, i] * f[2, k])
        out[i, i] += dilation - mu


@njit(cache=True)
def projected_blocks(law: Law, f: Array, g: Array, weight: float, work: Array, blocks: Array) -> None:
    """The same blocks of the projected stiffness; `work` is (12, 3, 3).

    In the frame of the singular vectors, with h = V^T g: scalings couple components i and j by S_ij h_i h'_j,
    twists and flips of the axes i and j put the mean of their eigenvalues on h_j h'_j and half their
    difference on h_j h'_i.
    """
    model, mu, lam = law
    u, v, scaling, mean, half, h, local = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    sigma, turned = work[7, 0], work[8]
    rotational_svd(f, u, sigma, v)
    projected_eigensystem(model, sigma, weight * mu, weight * lam, work[2:5], work[9:])
    for a in range(3):
        for k in range(3):
            h[a, k] = v[0, k] * g[a + 1, 0] + v[1, k] * g[a + 1, 1] + v[2, k] * g[a + 1, 2]
    for a in range(3):
        for b in range(a, 3):
            for i in range(3):
                local[i, i] = scaling[i, i] * h[a, i] * h[b, i]
                for j in range(3):
                    if i != j:
                        local[i, j] = scaling[i, j] * h[a, i] * h[b, j] + half[i, j] * h[a, j] * h[b, i]
                        local[i, i] += mean[i, j] * h[a, j] * h[b, j]
            for i in range(3):
                for j in range(3):
                    turned[i, j] = u[i, 0] * local[0, j] + u[i, 1] * local[1, j] + u[i, 2] * local[2, j]
            for i in range(3):
                for j in range(3):
                    blocks[a + 1, b + 1, i, j] = (
                        turned[i, 0] * u[j, 0] + turned[i, 1] * u[j, 1] + turned[i, 2] * u[j, 2]
                    )


@njit(cache=True, parallel=True)
def _energies_parallel(x: Array, body: ElementArrays, parts: int, out: Array) -> None:
    for part in prange(parts):
        _energies(x, body, len(out) * part // parts, len(out) * (part + 1) // parts, out)


@njit(cache=True, parallel=True)
def _forces_parallel(x: Array, body: ElementArrays, share: PartitionArrays, parts: int, out: Array) -> None:
    for part in prange(parts):
        _forces(x, body, share, part, out)


@njit(cache=True, parallel=True)
def _stiffness_parallel(
    x: Array,
    body: ElementArrays,
    share: PartitionArrays,
    slots: Slots,
    parts: int,
    project: bool,
    data: Array,
) -> None:
    for part in prange(parts):
        _stiffness(x, body, share, slots, part, project, data)


def energies(x: Array, body: ElementArrays, partition: Partition) -> Array:
    """Energies (m,) of the tets."""
    out = np.empty(len(body.tets))
    if partition.parts == 1:
        _energies(x, body, 0, len(out), out)
    else:
        _energies_parallel(x, body, partition.parts, out)
    return out


def forces(x: Array, body: ElementArrays, partition: Partition) -> Array:
    """Gradient (n, 3) of their sum."""
    out = np.empty_like(x)
    if partition.parts == 1:
        _forces(x, body, partition.share, 0, out)
    else:
        _forces_parallel(x, body, partition.share, partition.parts, out)
    return out


def stiffness(x: Array, body: ElementArrays, partition: Partition, pattern: Pattern, project: bool) -> Array:
    """Values of its Hessian in the order of the pattern."""
    data, slots = pattern.uninitialised(), Slots(pattern.indptr, pattern.slots, pattern.strides)
    if partition.parts == 1:
        _stiffness(x, body, partition.share, slots, 0, project, data)
    else:
        _stiffness_parallel(x, body, partition.share, slots, partition.parts, project, data)
    return data
