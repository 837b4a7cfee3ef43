"""Isotropic hyperelastic materials: energy density, first Piola stress and its derivative.

Derivatives are (9, 9) in the row-major order of F: entry (3 i + k, 3 j + l) is d P_ik / d F_jl.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from handpipe.core import Array, InputError
from handpipe.fem.elements.matrix3 import cofactor, determinant, rotational_svd, symmetric_eigen

Model = Literal["stable-neo-hookean", "stvk"]
MODELS: dict[str, int] = {"stable-neo-hookean": 0, "stvk": 1}
NEO_HOOKEAN = 0  # number of the model in `MODELS`, for compiled code


@dataclass(frozen=True)
class Material:
    """Isotropic hyperelastic material of a body, homogeneous or one a tet.

    "stable-neo-hookean": Smith et al. 2018 with their logarithm and parameters, shifted to zero energy at
    rest: m/2 (I - 3 - log((I + 1) / 4)) + l/2 (J - 1)^2 - 3/4 m (J - 1) with I = |F|^2, m = 4/3 mu and
    l = lambda + 5/6 mu, so that rest is stress-free and the moduli at small strains are those given.
    "stvk": mu |E|^2 + lambda/2 tr(E)^2 + lambda/2 (J - 1)^2; the added volume term doubles lambda at small
    strains.

    Parameters
    ----------
    young : float or array (m,)
        Young's modulus in kPa, above zero.
    poisson : float or array (m,)
        Poisson's ratio, zero or more and below 0.5.
    model : {"stable-neo-hookean", "stvk"}
        Energy density.

    Raises
    ------
    InputError
        For an unknown model, or if Young's modulus or Poisson's ratio is out of range.

    References
    ----------
    Smith et al. 2018; Wang 2019 §5.5.
    """

    young: float | ArrayLike
    poisson: float | ArrayLike
    model: Model = "stable-neo-hookean"

    def __post_init__(self) -> None:
        """Check model, Young's modulus and Poisson's ratio."""
        if self.model not in MODELS:
            raise InputError("Material", "model", f"is {self.model!r}", f"Use one of {', '.join(MODELS)}")
        young = np.asarray(self.young, dtype=float)
        if not np.all((young > 0) & np.isfinite(young)):
            raise InputError("Material", "young", "is not positive", "Give Young's modulus in kPa")
        poisson = np.asarray(self.poisson, dtype=float)
        if not np.all((poisson >= 0) & (poisson < 0.5)):
            raise InputError(
                "Material", "poisson", "is outside [0, 0.5)", "Use 0.48 for nearly incompressible"
            )

    def lame(self, count: int) -> tuple[Array, Array]:
        """Lame parameters (mu, lambda) in kPa, each (count,)."""
        young, nu = (
            np.broadcast_to(np.asarray(v, dtype=float), (count,)) for v in (self.young, self.poisson)
        )
        return young / (2 * (1 + nu)), young * nu / ((1 + nu) * (1 - 2 * nu))


@njit(cache=True, inline="always")
def rest_stable(mu: float, lam: float) -> tuple[float, float]:
    """Smith et al. 2018's own mu and lambda for Lame parameters seen at small strains."""
    return 4.0 / 3.0 * mu, lam + 5.0 / 6.0 * mu


@njit(cache=True, inline="always")
def _squares(f: Array) -> float:
    total = 0.0
    for i in range(3):
        for k in range(3):
            total += f[i, k] * f[i, k]
    return total


@njit(cache=True)
def energy_density(model: int, f: Array, mu: float, lam: float) -> float:
    """Energy per rest volume in kPa of a deformation gradient (3, 3)."""
    volume = determinant(f) - 1.0
    if model == NEO_HOOKEAN:
        m, bulk = rest_stable(mu, lam)
        excess = _squares(f) - 3.0
        return 0.5 * m * (excess - math.log1p(0.25 * excess)) + volume * (0.5 * bulk * volume - 0.75 * m)
    strain_squares = 0.0
    trace = 0.0
    for k in range(3):
        for m in range(3):
            e = 0.5 * (f[0, k] * f[0, m] + f[1, k] * f[1, m] + f[2, k] * f[2, m] - (1.0 if k == m else 0.0))
            strain_squares += e * e
            if k == m:
                trace += e
    return mu * strain_squares + 0.5 * lam * trace**2 + 0.5 * lam * volume**2


@njit(cache=True)
def piola(model: int, f: Array, mu: float, lam: float, out: Array) -> None:
    """First Piola stress (3, 3) in kPa."""
    cofactor(f, out)
    volume = determinant(f) - 1.0
    if model == NEO_HOOKEAN:
        m, bulk = rest_stable(mu, lam)
        pressure = bulk * volume - 0.75 * m
        shear = m * (1.0 - 1.0 / (_squares(f) + 1.0))
        for i in range(3):
            for k in range(3):
                out[i, k] = shear * f[i, k] + pressure * out[i, k]
        return
    trace = 0.5 * (_squares(f) - 3.0)
    for k in range(3):
        for i in range(3):
            out[i, k] = lam * volume * out[i, k] + (lam * trace - mu) * f[i, k]
            for p in range(3):
                out[i, k] += mu * f[i, p] * (f[0, p] * f[0, k] + f[1, p] * f[1, k] + f[2, p] * f[2, k])


@njit(cache=True)
def stiffness(model: int, f: Array, mu: float, lam: float, out: Array, work: Array) -> None:
    """Derivative (9, 9) of the first Piola stress; `work` is (3, 3)."""
    cofactor(f, work)
    neo = model == NEO_HOOKEAN
    m, bulk = rest_stable(mu, lam) if neo else (0.0, lam)
    pressure = bulk * (determinant(f) - 1.0) - 0.75 * m
    for a in range(9):
        for b in range(9):
            out[a, b] = bulk * work[a // 3, a % 3] * work[b // 3, b % 3]
    for i in range(3):  # pressure times the second derivative of J, eps_ijm eps_kln F_mn
        j1, j2 = (i + 1) % 3, (i + 2) % 3
        for k in range(3):
            k1, k2 = (k + 1) % 3, (k + 2) % 3
            out[3 * i + k, 3 * j1 + k1] += pressure * f[j2, k2]
            out[3 * i + k, 3 * j2 + k2] += pressure * f[j1, k1]
            out[3 * i + k, 3 * j1 + k2] -= pressure * f[j2, k1]
            out[3 * i + k, 3 * j2 + k1] -= pressure * f[j1, k2]
    if neo:
        inverse = 1.0 / (_squares(f) + 1.0)
        for a in range(9):
            for b in range(9):
                out[a, b] += 2.0 * m * inverse**2 * f[a // 3, a % 3] * f[b // 3, b % 3]
            out[a, a] += m * (1.0 - inverse)
    else:
        _add_stvk_stiffness(f, mu, lam, out, work)


@njit(cache=True)
def _add_stvk_stiffness(f: Array, mu: float, lam: float, out: Array, work: Array) -> None:
    trace = 0.5 * (_squares(f) - 3.0)
    for i in range(3):
        for k in range(3):
            work[i, k] = mu * (f[0, i] * f[0, k] + f[1, i] * f[1, k] + f[2, i] * f[2, k])
    for i in range(3):
        work[i, i] += lam * trace - mu  # now the second Piola stress
    for i in range(3):
        for j in range(3):
            outer = mu * (f[i, 0] * f[j, 0] + f[i, 1] * f[j, 1] + f[i, 2] * f[j, 2])
            for k in range(3):
                out[3 * i + k, 3 * j + k] += outer
                for m in range(3):
                    out[3 * i + k, 3 * j + m] += mu * f[i, m] * f[j, k] + lam * f[i, k] * f[j, m]
                    if i == j:
                        out[3 * i + k, 3 * j + m] += work[k, m]


@njit(cache=True)
def projected_eigensystem(model: int, sigma: Array, mu: float, lam: float, out: Array, work: Array) -> None:
    """Closed-form eigen-system of the stiffness with its negative part left out (Smith et al. 2019).

    In the frame of the singular vectors U, V of the rotational SVD, with singular values sigma (3,):
    `scaling`, out[0], couples the three scalings U diag(.) V^T; with `mean`, out[1], and `half`, out[2], the
    twist and the flip of axes i and j have the eigenvalues mean_ij - half_ij and mean_ij + half_ij. The
    quotients (psi_i -+ psi_j) / (sigma_i -+ sigma_j) are polynomials here, safe at equal singular values.
    `work` is (3, 3, 3).
    """
    scaling, mean, half = out[0], out[1], out[2]
    vectors, values, matrix = work[0], work[1, 0], work[2]
    neo = model == NEO_HOOKEAN
    m, bulk = rest_stable(mu, lam) if neo else (0.0, lam)
    pressure = bulk * (sigma[0] * sigma[1] * sigma[2] - 1.0) - 0.75 * m
    squares = sigma[0] ** 2 + sigma[1] ** 2 + sigma[2] ** 2
    dilation = 0.5 * lam * (squares - 3.0)
    shear = m * (1.0 - 1.0 / (squares + 1.0))
    coupling = 2.0 * m / (squares + 1.0) ** 2 if neo else lam
    for i in range(3):
        gi = sigma[(i + 1) % 3] * sigma[(i + 2) % 3]
        matrix[i, i] = bulk * gi * gi + coupling * sigma[i] ** 2
        matrix[i, i] += shear if neo else mu * (3.0 * sigma[i] ** 2 - 1.0) + dilation
        for j in range(i + 1, 3):
            volume = pressure * sigma[3 - i - j]
            gj = sigma[(j + 1) % 3] * sigma[(j + 2) % 3]
            matrix[i, j] = matrix[j, i] = bulk * gi * gj + coupling * sigma[i] * sigma[j] + volume
            common = shear if neo else mu * (sigma[i] ** 2 + sigma[j] ** 2 - 1.0) + dilation
            cross = -volume if neo else mu * sigma[i] * sigma[j] - volume
            twist, flip = max(common - cross, 0.0), max(common + cross, 0.0)
            mean[i, j] = mean[j, i] = 0.5 * (flip + twist)
            half[i, j] = half[j, i] = 0.5 * (flip - twist)
    symmetric_eigen(matrix, values, vectors)
    for i in range(3):
        for j in range(3):
            scaling[i, j] = 0.0
            for q in range(3):
                scaling[i, j] += max(values[q], 0.0) * vectors[i, q] * vectors[j, q]


@njit(cache=True)
def energy_densities(model: int, f: Array, mu: Array, lam: Array) -> Array:
    """Energy densities of deformation gradients.

    Parameters
    ----------
    model : int
        Number of the material model in `MODELS`.
    f : array (m, 3, 3)
        Deformation gradients.
    mu, lam : array (m,)
        Lame parameters in kPa.

    Returns
    -------
    array (m,)
        Energy per rest volume in kPa.
    """
    out = np.empty(len(f))
    for e in range(len(f)):
        out[e] = energy_density(model, f[e], mu[e], lam[e])
    return out


@njit(cache=True)
def piola_stresses(model: int, f: Array, mu: Array, lam: Array) -> Array:
    """First Piola stresses of deformation gradients.

    Parameters
    ----------
    model : int
        Number of the material model in `MODELS`.
    f : array (m, 3, 3)
        Deformation gradients.
    mu, lam : array (m,)
        Lame parameters in kPa.

    Returns
    -------
    array (m, 3, 3)
        Stresses in kPa.
    """
    out = np.empty_like(f)
    for e in range(len(f)):
        piola(model, f[e], mu[e], lam[e], out[e])
    return out


@njit(cache=True)
def stiffnesses(model: int, f: Array, mu: Array, lam: Array) -> Array:
    """Derivatives of first Piola stresses by deformation gradients.

    Parameters
    ----------
    model : int
        Number of the material model in `MODELS`.
    f : array (m, 3, 3)
        Deformation gradients.
    mu, lam : array (m,)
        Lame parameters in kPa.

    Returns
    -------
    array (m, 9, 9)
        Symmetric matrices in kPa; entry (3 i + k, 3 j + l) is d P_ik / d F_jl.
    """
    out, work = np.empty((len(f), 9, 9)), np.empty((3, 3))
    for e in range(len(f)):
        stiffness(model, f[e], mu[e], lam[e], out[e], work)
    return out


@njit(cache=True)
def semidefinite_stiffnesses(model: int, f: Array, mu: Array, lam: Array) -> Array:
    """Derivatives of first Piola stresses without the parts of negative eigenvalues.

    See `projected_eigensystem`.

    Parameters
    ----------
    model : int
        Number of the material model in `MODELS`.
    f : array (m, 3, 3)
        Deformation gradients.
    mu, lam : array (m,)
        Lame parameters in kPa.

    Returns
    -------
    array (m, 9, 9)
        Symmetric positive semidefinite matrices in kPa; entries in the order of `stiffnesses`.
    """
    out, work = np.zeros((len(f), 9, 9)), np.empty((3, 3, 3))
    u, v, sigma = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    system = np.zeros((3, 3, 3))
    scaling, mean, half = system[0], system[1], system[2]
    modes = np.empty((3, 3, 9))  # of row i and column j: u_i v_j^T
    for e in range(len(f)):
        rotational_svd(f[e], u, sigma, v)
        projected_eigensystem(model, sigma, mu[e], lam[e], system, work)
        for i in range(3):
            for j in range(3):
                for a in range(9):
                    modes[i, j, a] = u[a // 3, i] * v[a % 3, j]
        for i in range(3):
            for j in range(3):
                for a in range(9):
                    left = scaling[i, j] * modes[i, i, a]
                    for b in range(9):
                        out[e, a, b] += left * modes[j, j, b]
                        if i != j:
                            other = mean[i, j] * modes[i, j, b] + half[i, j] * modes[j, i, b]
                            out[e, a, b] += modes[i, j, a] * other
    return out
