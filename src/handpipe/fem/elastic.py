"""Hyperelastic tetrahedra under plastic strain: the energy whose minimum is a tissue's shape."""

from __future__ import annotations

import copy

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import NDArray

from handpipe.errors import InputError
from handpipe.fem import plasticity
from handpipe.fem.assembly import Pattern
from handpipe.fem.materials import MODELS, Material, energy_density, piola, projected_stiffness, stiffness

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]


class Elastic:
    """Energy sum of w V0 |Fp| psi(F Fp^-1) over tets (003 Eq. 5.1), in microjoules.

    vertices (n, 3) rest positions in mm, tets (m, 4) of positive volume, strains (m, 6) symmetric plastic
    strains (none: identity), weights (m,) scale the stiffness, e.g. by the share of a tet that tissue fills.
    Raises `InputError` where a tet or a plastic strain has no positive volume.
    """

    def __init__(
        self,
        vertices: Array,
        tets: IntArray,
        material: Material,
        strains: Array | None = None,
        weights: Array | None = None,
    ) -> None:
        self.tets = np.ascontiguousarray(tets, dtype=np.int64)
        self.vertices = np.ascontiguousarray(vertices, dtype=float)
        self.material = material
        self.pattern = Pattern.of_cells(self.tets, len(vertices))
        self._model = MODELS[material.model]
        self._mu, self._lam = (np.ascontiguousarray(v) for v in material.lame(len(tets)))
        self.rest_gradients, self.volumes = shape_gradients(self.vertices, self.tets)
        self.weights = np.ones(len(tets)) if weights is None else np.asarray(weights, dtype=float)
        self._set_strains(plasticity.identity(len(tets)) if strains is None else strains)

    def with_strains(self, strains: Array) -> Elastic:
        """The same body under other plastic strains (m, 6); shares the pattern."""
        other = copy.copy(self)
        other._set_strains(strains)
        return other

    def compressible(self, poisson: float = 0.3) -> Elastic:
        """The same body with Poisson's ratios above `poisson` lowered to it at equal shear stiffness."""
        other = copy.copy(self)
        other._lam = np.minimum(self._lam, self._mu * 2 * poisson / (1 - 2 * poisson))
        return other

    def nearly_incompressible(self, poisson: float = 0.4) -> bool:
        """Whether some tet has a Poisson's ratio above `poisson`."""
        return bool(np.any(self._lam > self._mu * 2 * poisson / (1 - 2 * poisson)))

    def inverted(self, x: Array) -> int:
        """Number of tets turned inside out at x (n, 3)."""
        return int((np.linalg.det(self.elastic_gradients(x)) <= 0).sum())

    def _set_strains(self, strains: Array) -> None:
        self.strains = np.ascontiguousarray(strains, dtype=float)
        ratios = plasticity.determinants(self.strains)
        if np.any(ratios <= 0):
            worst = int(np.argmin(ratios))
            problem = f"tet {worst} has determinant {ratios[worst]:.3g}"
            raise InputError("plastic strains", "strains", problem, "Use positive definite strains")
        inverses = plasticity.inverse_matrices(self.strains)
        # F Fp^-1 is linear in x with the gradients B Fp^-1: plastic strain costs the kernels nothing.
        self._gradients = np.ascontiguousarray(self.rest_gradients @ inverses)
        self._energies = self.weights * self.volumes * ratios

    def value(self, x: Array) -> float:
        return _value(x, self.tets, self._gradients, self._energies, self._model, self._mu, self._lam)

    def gradient(self, x: Array) -> Array:
        return _gradient(x, self.tets, self._gradients, self._energies, self._model, self._mu, self._lam)

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        data = self.pattern.data()
        _hessian(
            x,
            self.tets,
            self._gradients,
            self._energies,
            self._model,
            self._mu,
            self._lam,
            project,
            self.pattern.slots,
            self.pattern.strides,
            data,
        )
        return self.pattern.matrix(data)

    def deformation_gradients(self, x: Array) -> Array:
        """F (m, 3, 3) from the rest positions, plastic part included."""
        return deformation_gradients(x, self.tets, self.rest_gradients)

    def elastic_gradients(self, x: Array) -> Array:
        """F Fp^-1 (m, 3, 3)."""
        return deformation_gradients(x, self.tets, self._gradients)

    def strain_jacobian(self, x: Array) -> sp.csr_matrix:
        """Derivative (3n, 6m) of the gradient by the strains; column 6 e + j is number j of tet e."""
        data = _strain_jacobian(
            self.elastic_gradients(x),
            plasticity.inverse_matrices(self.strains),
            self.rest_gradients,
            self._energies,
            self._model,
            self._mu,
            self._lam,
        )
        rows = np.repeat((3 * self.tets[:, :, None] + np.arange(3)).reshape(-1, 1, 12), 6, axis=1)
        starts = np.arange(0, rows.size + 1, 12)
        shape = (3 * len(self.vertices), 6 * len(self.tets))
        return sp.csc_matrix((data.ravel(), rows.ravel(), starts), shape=shape).tocsr()


def shape_gradients(vertices: Array, tets: IntArray) -> tuple[Array, Array]:
    """Gradients (m, 4, 3) of the linear shape functions, and volumes (m,), of which all must be positive."""
    corners = vertices[tets]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    volumes = np.linalg.det(edges) / 6
    if np.any(volumes <= 0):
        worst = int(np.argmin(volumes))
        problem = f"tet {worst} has volume {volumes[worst]:.3g} mm3"
        raise InputError("tetrahedra", "tets", problem, "Order the corners so that volumes are positive")
    inverses = np.linalg.inv(edges)
    return np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1), volumes


@njit(cache=True, inline="always")
def _gather(x: Array, tet: IntArray, gradients: Array, f: Array) -> None:
    for i in range(3):
        for k in range(3):
            s = 0.0
            for a in range(4):
                s += x[tet[a], i] * gradients[a, k]
            f[i, k] = s


@njit(cache=True)
def deformation_gradients(x: Array, tets: IntArray, gradients: Array) -> Array:
    """F (m, 3, 3) of positions (n, 3), tets (m, 4) and shape gradients (m, 4, 3)."""
    out = np.empty((len(tets), 3, 3))
    for e in range(len(tets)):
        _gather(x, tets[e], gradients[e], out[e])
    return out


@njit(cache=True)
def _value(
    x: Array, tets: IntArray, gradients: Array, energies: Array, model: int, mu: Array, lam: Array
) -> float:
    f = np.empty((3, 3))
    total = 0.0
    for e in range(len(tets)):
        _gather(x, tets[e], gradients[e], f)
        total += energies[e] * energy_density(model, f, mu[e], lam[e])
    return total


@njit(cache=True)
def _gradient(
    x: Array, tets: IntArray, gradients: Array, energies: Array, model: int, mu: Array, lam: Array
) -> Array:
    out = np.zeros_like(x)
    f, p = np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(tets)):
        _gather(x, tets[e], gradients[e], f)
        piola(model, f, mu[e], lam[e], p)
        for a in range(4):
            for i in range(3):
                s = 0.0
                for k in range(3):
                    s += p[i, k] * gradients[e, a, k]
                out[tets[e, a], i] += energies[e] * s
    return out


@njit(cache=True)
def _hessian(
    x: Array,
    tets: IntArray,
    gradients: Array,
    energies: Array,
    model: int,
    mu: Array,
    lam: Array,
    project: bool,
    slots: Int32Array,
    strides: Int32Array,
    data: Array,
) -> None:
    f, dp, work = np.empty((3, 3)), np.empty((9, 9)), np.empty((8, 3, 3))
    half = np.empty((9, 4, 3))
    for e in range(len(tets)):
        b = gradients[e]
        _gather(x, tets[e], b, f)
        if project:
            projected_stiffness(model, f, mu[e], lam[e], dp, work)
        else:
            stiffness(model, f, mu[e], lam[e], dp, work[0])
        for r in range(9):
            for c in range(4):
                for j in range(3):
                    s = dp[r, 3 * j] * b[c, 0] + dp[r, 3 * j + 1] * b[c, 1] + dp[r, 3 * j + 2] * b[c, 2]
                    half[r, c, j] = energies[e] * s
        for a in range(4):
            stride = strides[tets[e, a]]
            for c in range(4):
                start = slots[16 * e + 4 * a + c]
                for i in range(3):
                    for j in range(3):
                        data[start + i * stride + j] += (
                            b[a, 0] * half[3 * i, c, j]
                            + b[a, 1] * half[3 * i + 1, c, j]
                            + b[a, 2] * half[3 * i + 2, c, j]
                        )


@njit(cache=True)
def _strain_jacobian(
    elastic: Array, inverses: Array, gradients: Array, energies: Array, model: int, mu: Array, lam: Array
) -> Array:
    """Values (m, 6, 12), by 003 Eq. B.6 to B.8 in terms of Q = |Fp| P Fp^-T."""
    out = np.empty((len(elastic), 6, 12))
    p, dp, work = np.empty((3, 3)), np.empty((9, 9)), np.empty((3, 3))
    y = np.zeros((3, 3))
    for e in range(len(elastic)):
        f, g = elastic[e], inverses[e]
        piola(model, f, mu[e], lam[e], p)
        stiffness(model, f, mu[e], lam[e], dp, work)
        number = 0
        for r in range(3):
            for c in range(r, 3):
                y[:] = 0.0
                y[r, c] = y[c, r] = 1.0
                yg = y @ g
                change = f @ yg  # minus the change of F Fp^-1
                stress = (yg[0, 0] + yg[1, 1] + yg[2, 2]) * (p @ g) - p @ (g @ yg)
                dstress = np.zeros((3, 3))
                for q in range(9):
                    s = 0.0
                    for t in range(9):
                        s += dp[q, t] * change[t // 3, t % 3]
                    dstress[q // 3, q % 3] = s
                stress -= dstress @ g
                for a in range(4):
                    for i in range(3):
                        s = 0.0
                        for k in range(3):
                            s += stress[i, k] * gradients[e, a, k]
                        out[e, number, 3 * a + i] = energies[e] * s
                number += 1
    return out
