"""Symmetric strains as six numbers a tet (xx, xy, xz, yy, yz, zz), and the polar decomposition.

All functions take many tets at once. Matrices flatten row-major: entry (i, k) of F is number 3 i + k of 9.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numba import njit

from handpipe.core import Array, InputError
from handpipe.fem.elements.matrix3 import rotational_svd

ROWS = np.array([0, 0, 0, 1, 1, 2])
COLUMNS = np.array([0, 1, 2, 1, 2, 2])
PLACES = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
IDENTITY = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])  # the six numbers of no strain
SERIES = 1e-4  # half difference of strains, below which a series takes the place of the formula


def identity(count: int) -> Array:
    """No plastic strain: (count, 6)."""
    return np.tile(IDENTITY, (count, 1))


def to_matrices(strains: Array) -> Array:
    """Symmetric matrices (m, 3, 3) of strains (m, 6) (Wang 2021 Eq. 5.2)."""
    return np.asarray(strains)[:, PLACES]


def from_matrices(matrices: Array) -> Array:
    """Strains (m, 6) of matrices (m, 3, 3), of which the symmetric part counts."""
    a = np.asarray(matrices)
    return 0.5 * (a[:, ROWS, COLUMNS] + a[:, COLUMNS, ROWS])


def eigenvalues(strains: Array) -> Array:
    """Principal values (m, 3), ascending."""
    return np.linalg.eigvalsh(to_matrices(strains)).astype(np.float64)


def determinants(strains: Array) -> Array:
    """Volume ratios (m,)."""
    return np.linalg.det(to_matrices(strains)).astype(np.float64)


def inverse(strains: Array) -> Array:
    """Strains (m, 6) of the inverse matrices."""
    return from_matrices(inverse_matrices(strains))


def inverse_matrices(strains: Array) -> Array:
    """Inverse matrices (m, 3, 3)."""
    return np.linalg.inv(to_matrices(strains)).astype(np.float64)


def exp(strains: Array) -> Array:
    """Matrix exponential: any six numbers become a positive definite strain."""
    values, vectors = np.linalg.eigh(to_matrices(strains))
    return from_matrices((vectors * np.exp(values)[:, None, :]) @ vectors.transpose(0, 2, 1))


def log(strains: Array) -> Array:
    """Matrix logarithm of positive definite strains.

    Raises
    ------
    InputError
        If a strain is not positive definite.
    """
    values, vectors = np.linalg.eigh(to_matrices(strains))
    if np.any(values <= 0):
        worst = int(np.argmin(values[:, 0]))
        problem = f"strain {worst} has the principal value {values[worst, 0]:.3g}"
        raise InputError("plastic strains", "log", problem, "Logarithms need positive definite strains")
    return from_matrices((vectors * np.log(values)[:, None, :]) @ vectors.transpose(0, 2, 1))


def exp_derivative(strains: Array) -> Array:
    """Derivative (m, 6, 6) of `exp`: entry (a, b) is d exp(s)_a / d s_b (Daleckii and Krein's formula)."""
    values, vectors = np.linalg.eigh(to_matrices(strains))
    half_sum = 0.5 * (values[:, :, None] + values[:, None, :])
    half_difference = 0.5 * (values[:, :, None] - values[:, None, :])
    small = np.abs(half_difference) < SERIES
    safe = np.where(small, 1.0, half_difference)
    quotients = np.exp(half_sum) * np.where(small, 1 + half_difference**2 / 6, np.sinh(safe) / safe)
    directions = to_matrices(np.eye(6))
    inner = np.einsum("mpi,bpq,mqj->mbij", vectors, directions, vectors, optimize=True) * quotients[:, None]
    outer = np.einsum("mpi,mbij,mqj->mbpq", vectors, inner, vectors, optimize=True)
    return outer[:, :, ROWS, COLUMNS].transpose(0, 2, 1)


def per_tet_operator(blocks: Array) -> sp.bsr_matrix:
    """Block-diagonal operator of blocks (m, p, q), e.g. the chain rule of a change of strain variables."""
    m, p, q = blocks.shape
    return sp.bsr_matrix((blocks, np.arange(m), np.arange(m + 1)), shape=(m * p, m * q))


@njit(cache=True)
def polar(f: Array) -> tuple[Array, Array]:
    """Polar decomposition F = R S with rotations R and symmetric S.

    Parameters
    ----------
    f : array (m, 3, 3)
        Deformation gradients F.

    Returns
    -------
    rotations : array (m, 3, 3)
        R, det R = 1.
    stretches : array (m, 6)
        S as xx, xy, xz, yy, yz, zz. Where F is inverted the least principal value of S is negative, so that S
        is smooth through det F = 0.
    """
    rotations, stretches = np.empty_like(f), np.empty((len(f), 6))
    u, v, sigma = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for e in range(len(f)):
        rotational_svd(f[e], u, sigma, v)
        at = 0
        for i in range(3):
            for k in range(3):
                rotations[e, i, k] = u[i, 0] * v[k, 0] + u[i, 1] * v[k, 1] + u[i, 2] * v[k, 2]
                if k >= i:
                    s = 0.0
                    for p in range(3):
                        s += sigma[p] * v[i, p] * v[k, p]
                    stretches[e, at] = s
                    at += 1
    return rotations, stretches


@njit(cache=True)
def _safe_sum(a: float, b: float, scale: float) -> float:
    """sigma_a + sigma_b away from zero: there R is not unique, and any finite derivative serves."""
    total = a + b
    floor = 1e-8 * max(abs(scale), 1e-8)
    return total if total > floor else floor


@njit(cache=True)
def polar_gradient(f: Array) -> Array:
    """dS/dF (m, 6, 9) of the polar decomposition (Wang 2021 §5.7).

    In the frame of the SVD, with D = U^T dF V, the Sylvester equation (Wang 2021 Eq. 5.22) is diagonal:
    dS_ij = (sigma_i D_ij + sigma_j D_ji) / (sigma_i + sigma_j).
    """
    out = np.empty((len(f), 6, 9))
    u, v, sigma, d = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    for e in range(len(f)):
        rotational_svd(f[e], u, sigma, v)
        for a in range(3):
            for b in range(3):
                for i in range(3):
                    for j in range(i, 3):
                        dij, dji = u[a, i] * v[b, j], u[a, j] * v[b, i]
                        if i == j:
                            d[i, j] = dij
                        else:
                            top = sigma[i] * dij + sigma[j] * dji
                            d[i, j] = top / _safe_sum(sigma[i], sigma[j], sigma[0])
                        d[j, i] = d[i, j]
                at = 0
                for i in range(3):
                    for k in range(i, 3):
                        s = 0.0
                        for p in range(3):
                            for q in range(3):
                                s += v[i, p] * d[p, q] * v[k, q]
                        out[e, at, 3 * a + b] = s
                        at += 1
    return out


@njit(cache=True)
def polar_hessian(f: Array, weights: Array) -> Array:
    """Second derivative (m, 9, 9) of w . S(F) for weights w (m, 6) on the six numbers of S.

    In the frame of the SVD, dR = Omega with Omega_ij = (D_ij - D_ji) / (sigma_i + sigma_j). Differentiating
    S = R^T F twice and asking for symmetry gives d2S = T(M), where T is the map of `polar_gradient` and
    M = (O1 O2 + O2 O1) Sigma / 2 - O1 D2 - O2 D1. The adjoint of T takes the weights to N once, so that no
    third-order array is formed. In contrast to Wang 2021 Eq. E.5 there is no division by a single singular
    value, which may vanish.
    """
    out = np.empty((len(f), 9, 9))
    u, v, sigma, adjoint = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((3, 3))
    local, frame = np.empty((9, 9)), np.empty((9, 9))
    for e in range(len(f)):
        rotational_svd(f[e], u, sigma, v)
        _weights_in_frame(weights[e], v, adjoint)
        for i in range(3):
            for j in range(3):
                if i != j:
                    adjoint[i, j] *= 2.0 * sigma[i] / _safe_sum(sigma[i], sigma[j], sigma[0])
        _frame_hessian(adjoint, sigma, local)
        for i in range(3):
            for j in range(3):
                for a in range(3):
                    for b in range(3):
                        frame[3 * i + j, 3 * a + b] = u[a, i] * v[b, j]
        out[e] = frame.T @ local @ frame
    return out


@njit(cache=True)
def _weights_in_frame(weights: Array, v: Array, out: Array) -> None:
    """V^T W V, with W the symmetric matrix for which <W, S> is the weighted sum of the six numbers."""
    for p in range(3):
        for q in range(3):
            s = 0.0
            at = 0
            for i in range(3):
                s += weights[at] * v[i, p] * v[i, q]
                at += 1
                for k in range(i + 1, 3):
                    s += 0.5 * weights[at] * (v[i, p] * v[k, q] + v[k, p] * v[i, q])
                    at += 1
            out[p, q] = s


@njit(cache=True)
def _frame_hessian(adjoint: Array, sigma: Array, out: Array) -> None:
    """<N, M> (9, 9) for the nine unit directions of the frame."""
    axes = np.zeros((9, 3))  # Omega of each direction as an axis
    for a in range(3):
        for b in range(3):
            if a != b:
                sign = -1.0 if (b - a) % 3 == 1 else 1.0
                axes[3 * a + b, 3 - a - b] = sign / _safe_sum(sigma[a], sigma[b], sigma[0])
    for c in range(9):
        for d in range(9):
            total = 0.0
            for i in range(3):
                for j in range(3):
                    product = 0.5 * (axes[d, i] * axes[c, j] + axes[c, i] * axes[d, j])
                    total += adjoint[i, j] * sigma[j] * product
                    if i == j:
                        dot = axes[c, 0] * axes[d, 0] + axes[c, 1] * axes[d, 1] + axes[c, 2] * axes[d, 2]
                        total -= adjoint[i, j] * sigma[j] * dot
            out[c, d] = total - _turned(adjoint, axes[c], d) - _turned(adjoint, axes[d], c)


@njit(cache=True)
def _turned(adjoint: Array, axis: Array, direction: int) -> float:
    """<N, Omega E> for a unit direction E."""
    p, q = direction // 3, direction % 3
    p1, p2 = (p + 1) % 3, (p + 2) % 3
    return adjoint[p1, q] * axis[p2] - adjoint[p2, q] * axis[p1]
