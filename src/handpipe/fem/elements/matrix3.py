"""3x3 matrices inside compiled loops: determinant, cofactors, symmetric eigenvectors, rotational SVD."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from handpipe.core import Array

SWEEPS = 12  # of Jacobi rotations; four or five suffice in double precision


@njit(cache=True, inline="always")
def determinant(a: Array) -> float:
    """Determinant of (3, 3)."""
    return (
        a[0, 0] * (a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1])
        - a[0, 1] * (a[1, 0] * a[2, 2] - a[1, 2] * a[2, 0])
        + a[0, 2] * (a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0])
    )


@njit(cache=True, inline="always")
def cofactor(a: Array, out: Array) -> None:
    """Cofactors of (3, 3): the derivative of its determinant."""
    out[0, 0] = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    out[0, 1] = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    out[0, 2] = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    out[1, 0] = a[2, 1] * a[0, 2] - a[2, 2] * a[0, 1]
    out[1, 1] = a[2, 2] * a[0, 0] - a[2, 0] * a[0, 2]
    out[1, 2] = a[2, 0] * a[0, 1] - a[2, 1] * a[0, 0]
    out[2, 0] = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    out[2, 1] = a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2]
    out[2, 2] = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]


@njit(cache=True)
def symmetric_eigen(a: Array, values: Array, vectors: Array) -> None:
    """Eigenvalues (3,) and eigenvectors (columns) of a symmetric (3, 3) by Jacobi; `a` is overwritten."""
    vectors[:] = 0.0
    for i in range(3):
        vectors[i, i] = 1.0
    for _ in range(SWEEPS):
        off = a[0, 1] ** 2 + a[0, 2] ** 2 + a[1, 2] ** 2
        if off <= 1e-32 * (a[0, 0] ** 2 + a[1, 1] ** 2 + a[2, 2] ** 2):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if a[p, q] == 0.0:
                    continue
                theta = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
                t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    akp, akq = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * akp - s * akq, s * akp + c * akq
                for k in range(3):
                    apk, aqk = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * apk - s * aqk, s * apk + c * aqk
                for k in range(3):
                    vkp, vkq = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * vkp - s * vkq, s * vkp + c * vkq
    for i in range(3):
        values[i] = a[i, i]


@njit(cache=True)
def rotational_svd(f: Array, u: Array, sigma: Array, v: Array) -> None:
    """F = U diag(sigma) V^T with U and V rotations; the last singular value carries the sign of det F.

    One-sided Jacobi rotations of the columns of F: small singular values keep their relative accuracy,
    and rank one or zero is completed to rotations.
    """
    largest = np.abs(f).max()
    scale = largest if largest > 0.0 else 1.0  # squares of tiny or huge entries would under- or overflow
    v[:] = 0.0
    for i in range(3):
        v[i, i] = 1.0
        for k in range(3):
            u[i, k] = f[i, k] / scale
    for _ in range(SWEEPS):
        rotated = False
        for p in range(2):
            for q in range(p + 1, 3):
                alpha = u[0, p] ** 2 + u[1, p] ** 2 + u[2, p] ** 2
                beta = u[0, q] ** 2 + u[1, q] ** 2 + u[2, q] ** 2
                gamma = u[0, p] * u[0, q] + u[1, p] * u[1, q] + u[2, p] * u[2, q]
                if abs(gamma) <= 1e-15 * math.sqrt(alpha * beta) or gamma == 0.0:
                    continue
                rotated = True
                zeta = (beta - alpha) / (2.0 * gamma)
                t = math.copysign(1.0, zeta) / (abs(zeta) + math.sqrt(zeta * zeta + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    up, uq = u[k, p], u[k, q]
                    u[k, p], u[k, q] = c * up - s * uq, s * up + c * uq
                    vp, vq = v[k, p], v[k, q]
                    v[k, p], v[k, q] = c * vp - s * vq, s * vp + c * vq
        if not rotated:
            break
    for i in range(3):
        sigma[i] = math.sqrt(u[0, i] ** 2 + u[1, i] ** 2 + u[2, i] ** 2)
    for i in range(2):
        for j in range(2 - i):
            if sigma[j] < sigma[j + 1]:
                sigma[j], sigma[j + 1] = sigma[j + 1], sigma[j]
                for k in range(3):
                    u[k, j], u[k, j + 1] = u[k, j + 1], u[k, j]
                    v[k, j], v[k, j + 1] = v[k, j + 1], v[k, j]
    if determinant(v) < 0.0:
        for k in range(3):
            v[k, 2] = -v[k, 2]
            u[k, 2] = -u[k, 2]
    _orthonormal_columns(u, sigma)
    for i in range(3):
        sigma[i] *= scale


@njit(cache=True)
def _orthonormal_columns(u: Array, sigma: Array) -> None:
    """Turn the orthogonal columns U diag(sigma) into a rotation, giving the sign to sigma[2]."""
    tiny = 1e-14 * sigma[0]
    if sigma[0] == 0.0:
        u[:] = 0.0
        for i in range(3):
            u[i, i] = 1.0
        return
    for k in range(3):
        u[k, 0] /= sigma[0]
    if sigma[1] > tiny:
        for k in range(3):
            u[k, 1] /= sigma[1]
    else:
        axis = 0
        for k in range(1, 3):
            if abs(u[k, 0]) < abs(u[axis, 0]):
                axis = k
        norm = math.sqrt(1.0 - u[axis, 0] ** 2)
        for k in range(3):
            u[k, 1] = ((1.0 if k == axis else 0.0) - u[axis, 0] * u[k, 0]) / norm
    x = u[1, 0] * u[2, 1] - u[2, 0] * u[1, 1]
    y = u[2, 0] * u[0, 1] - u[0, 0] * u[2, 1]
    z = u[0, 0] * u[1, 1] - u[1, 0] * u[0, 1]
    if u[0, 2] * x + u[1, 2] * y + u[2, 2] * z < 0.0:
        sigma[2] = -sigma[2]
    u[0, 2], u[1, 2], u[2, 2] = x, y, z
