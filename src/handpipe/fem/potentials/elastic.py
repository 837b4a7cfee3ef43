"""Hyperelastic tetrahedra under plastic strain: the energy whose minimum is a tissue's shape."""

from __future__ import annotations

import copy

import numpy as np
import scipy.sparse as sp
from numba import get_num_threads, njit

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.fem.elements import plasticity, tet_kernels
from handpipe.fem.elements.crushing import Crushing
from handpipe.fem.elements.materials import MODELS, Material, piola, piola_stresses, stiffness
from handpipe.fem.elements.tangles import Tangles
from handpipe.fem.elements.tet_checks import check_tets
from handpipe.fem.elements.tet_kernels import ElementArrays, gather
from handpipe.fem.patterns.assembly import Pattern
from handpipe.fem.patterns.partition import Partition, spatial_order

PARALLEL_TETS = 30_000  # below, on a busy machine waiting for the other thread costs more than it saves


class Elastic:
    """Elastic body under plastic strain: energy sum of w V0 |Fp| psi(F Fp^-1) over tets.

    Parameters
    ----------
    vertices : array (n, 3)
        Rest positions in mm.
    tets : integer array (m, 4)
        Linear tets of positive volume.
    material : Material
        Energy density psi.
    strains : array (m, 6), optional
        Symmetric positive definite plastic strains Fp as xx, xy, xz, yy, yz, zz; by default the identity.
    weights : array (m,), optional
        Factors w of the stiffness, zero or more, e.g. the share of a tet that tissue fills; by default one.

    Raises
    ------
    InputError
        If a tet or a plastic strain has no positive volume, tets are repeated, more than two tets share a
        face, tets are not linear, an array is misshapen, a position is not finite, or a weight is negative.

    References
    ----------
    Wang 2021 Eq. 5.1.
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
        check_tets(self.vertices, self.tets)
        self.material = material
        self._model = MODELS[material.model]
        self._mu, self._lam = (np.ascontiguousarray(v) for v in material.lame(len(tets)))
        self.rest_gradients, self.volumes = shape_gradients(self.vertices, self.tets)
        self.tangles = Tangles(self.vertices, self.tets)
        # Cells that come soon after one another share rows of the Hessian, which then are in the cache.
        order = spatial_order(self.vertices[self.tets].mean(axis=1))
        cells = self.tets[order]
        self._order = order
        self.pattern = Pattern.of_cells(cells, len(vertices))
        parts = get_num_threads() if len(tets) >= PARALLEL_TETS else 1
        self._partition = Partition.of_cells(cells, self.vertices, parts)
        self._body = ElementArrays(
            cells, self.rest_gradients, self.volumes, self._model, self._mu[order], self._lam[order]
        )
        self.weights = np.ones(len(tets)) if weights is None else _checked_weights(weights, len(tets))
        self._set_strains(plasticity.identity(len(tets)) if strains is None else strains)

    def with_strains(self, strains: Array) -> Elastic:
        """The same body under other plastic strains (m, 6); shares the pattern."""
        other = copy.copy(self)
        other._set_strains(strains)
        return other

    def resting(self, x: Array, share: float) -> Elastic:
        """A body of a share of the stiffness that rests in positions x (n, 3), without plastic strains.

        Raises
        ------
        InputError
            If a tet has no positive volume there.
        """
        other = copy.copy(self)
        other.vertices = np.ascontiguousarray(x, dtype=float)
        other.rest_gradients, other.volumes = shape_gradients(other.vertices, self.tets)
        other.weights = share * self.weights * self.volumes / other.volumes  # as much material as before
        other.tangles = Tangles(other.vertices, self.tets)
        other._set_strains(plasticity.identity(len(self.tets)))
        return other

    def compressible(self, poisson: float = 0.3) -> Elastic:
        """The same body with Poisson's ratios above `poisson` lowered to it at equal shear stiffness."""
        other = copy.copy(self)
        other._lam = np.minimum(self._lam, self._mu * 2 * poisson / (1 - 2 * poisson))
        other._body = self._body._replace(lam=other._lam[self._order])
        return other

    def nearly_incompressible(self, poisson: float = 0.4) -> bool:
        """Whether some tet has a Poisson's ratio above `poisson`."""
        return bool(np.any(self._lam > self._mu * 2 * poisson / (1 - 2 * poisson)))

    def near(self, moving: BoolArray, kept: IntArray) -> Elastic:
        """The energy of the tets that have a vertex of a mask (n,), as `Sum.near` says."""
        mine = np.flatnonzero(moving[self._body.tets].any(axis=1))
        other, ids = copy.copy(self), self._order[mine]
        for name in ("rest_gradients", "volumes", "weights", "strains", "_mu", "_lam"):
            setattr(other, name, getattr(self, name)[ids])
        other.vertices, other._order = self.vertices[kept], np.arange(len(ids))
        other.tets = np.searchsorted(kept, self._body.tets[mine])
        body = self._body
        other._body = body._replace(
            tets=other.tets,
            gradients=body.gradients[mine],
            weights=body.weights[mine],
            mu=body.mu[mine],
            lam=body.lam[mine],
        )
        other.pattern = Pattern.of_cells(other.tets, len(kept))
        other._partition = Partition.of_cells(other.tets, other.vertices, 1)
        return other

    def crushing(self, steepest: float) -> Crushing:
        """The barrier that keeps this body's tets from inversion, quadratic below a share of its onset."""
        return Crushing(self._body, self.pattern, steepest)

    def volume_ratios(self, x: Array) -> Array:
        """det(F Fp^-1) (m,) of the tets."""
        out = np.empty(len(self.tets))
        out[self._order] = tet_kernels.volume_ratios(_coordinates(x), self._body)
        return out

    def _set_strains(self, strains: Array) -> None:
        self.strains = np.ascontiguousarray(strains, dtype=float)
        # F Fp^-1 is linear in x with the gradients B Fp^-1: plastic strain adds no work to the kernels.
        gradients, weights = np.empty_like(self.rest_gradients), np.empty(len(self.tets))
        stiff_volumes = self.weights * self.volumes
        worst = _strained(self._order, self.strains, self.rest_gradients, stiff_volumes, gradients, weights)
        if worst >= 0:
            ratio = plasticity.determinants(self.strains[worst : worst + 1])[0]
            problem = f"tet {worst} has determinant {ratio:.3g}"
            raise InputError("plastic strains", "strains", problem, "Use positive definite strains")
        self._body = self._body._replace(gradients=gradients, weights=weights)

    def value(self, x: Array) -> float:
        """Energy in microjoules, summed over tets."""
        return float(tet_kernels.energies(_coordinates(x), self._body, self._partition).sum())

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus the force."""
        return tet_kernels.forces(_coordinates(x), self._body, self._partition)

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Exact second derivative (3n, 3n) in mN/mm; with `project`, made semidefinite tet by tet."""
        data = tet_kernels.stiffness(_coordinates(x), self._body, self._partition, self.pattern, project)
        return self.pattern.matrix(data)

    def force_sizes(self, x: Array) -> Array:
        """Sum (n,) of the sizes in mN of the forces that tets put on each vertex."""
        out = np.zeros(len(self.vertices))
        tet_kernels.force_sizes(_coordinates(x), self._body, out)
        return out

    def resistance(self) -> Array:
        """Force (n,) in mN on each vertex with which its tets resist a shear strain of one, at rest."""
        sizes = np.sqrt((self._body.gradients**2).sum(axis=2))
        forces = 2.0 * (self._body.weights * self._body.mu)[:, None] * sizes
        corners = self._body.tets.ravel()
        return np.bincount(corners, forces.ravel(), minlength=len(self.vertices)).astype(float)

    def deformation_gradients(self, x: Array) -> Array:
        """F (m, 3, 3) from the rest positions, plastic part included."""
        return deformation_gradients(x, self.tets, self.rest_gradients)

    def elastic_gradients(self, x: Array) -> Array:
        """F Fp^-1 (m, 3, 3)."""
        out = np.empty((len(self.tets), 3, 3))
        out[self._order] = deformation_gradients(x, self._body.tets, self._body.gradients)
        return out

    def cauchy_stresses(self, x: Array) -> Array:
        """Cauchy stress (m, 3, 3) in kPa of each tet: w P(Fe) Fe^T / det Fe, of Fe = F Fp^-1.

        Integrated against the gradients of the shape functions at x it gives `gradient`. It is the mean over
        a tet of which tissue fills the share w.
        """
        elastic = self.elastic_gradients(x)
        first = piola_stresses(self._model, elastic, self._mu, self._lam)
        ratios = self.weights / np.linalg.det(elastic)
        return ratios[:, None, None] * (first @ elastic.transpose(0, 2, 1))

    def strain_jacobian(self, x: Array) -> sp.csr_matrix:
        """Derivative (3n, 6m) of the gradient by the strains; column 6 e + j is number j of tet e."""
        data = _strain_jacobian(
            self.elastic_gradients(x),
            plasticity.inverse_matrices(self.strains),
            self.rest_gradients,
            self.weights * self.volumes * plasticity.determinants(self.strains),
            self._model,
            self._mu,
            self._lam,
        )
        rows = np.repeat((3 * self.tets[:, :, None] + np.arange(3)).reshape(-1, 1, 12), 6, axis=1)
        starts = np.arange(0, rows.size + 1, 12)
        shape = (3 * len(self.vertices), 6 * len(self.tets))
        return sp.csc_matrix((data.ravel(), rows.ravel(), starts), shape=shape).tocsr()


def _checked_weights(weights: Array, count: int) -> Array:
    array = np.asarray(weights, dtype=float)
    if array.shape != (count,) or not np.all(np.isfinite(array) & (array >= 0)):
        problem = f"of shape {array.shape} for {count} tets, or negative, or not finite"
        raise InputError("tetrahedra", "weights", problem, "Give one weight of zero or more a tet")
    return array


def _coordinates(x: Array) -> Array:
    return np.ascontiguousarray(x, dtype=float)


def shape_gradients(vertices: Array, tets: IntArray) -> tuple[Array, Array]:
    """Gradients of the linear shape functions of tets, and their volumes.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm.
    tets : integer array (m, 4)
        Tets of positive volume.

    Returns
    -------
    gradients : array (m, 4, 3)
        Gradient of the shape function of each corner in 1/mm.
    volumes : array (m,)
        Volumes in mm^3.

    Raises
    ------
    InputError
        If a volume is not positive.
    """
    corners = vertices[tets]
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    volumes = np.linalg.det(edges) / 6
    if not np.all(volumes > 0):
        worst = int(np.argmin(volumes))
        problem = f"tet {worst} has volume {volumes[worst]:.3g} mm3"
        raise InputError("tetrahedra", "tets", problem, "Order the corners so that volumes are positive")
    inverses = np.linalg.inv(edges)
    return np.concatenate([-inverses.sum(axis=1, keepdims=True), inverses], axis=1), volumes


@njit(cache=True)
def deformation_gradients(x: Array, tets: IntArray, gradients: Array) -> Array:
    """F (m, 3, 3) of positions (n, 3), tets (m, 4) and shape gradients (m, 4, 3)."""
    out = np.empty((len(tets), 3, 3))
    for e in range(len(tets)):
        gather(x, tets[e], gradients[e], out[e])
    return out


@njit(cache=True)
def _strained(
    order: IntArray,
    strains: Array,
    rest_gradients: Array,
    stiff_volumes: Array,
    gradients: Array,
    weights: Array,
) -> int:
    """Fill B Fp^-1 and w V0 |Fp| of tets in their order of assembly; a tet with |Fp| <= 0, or -1."""
    worst = -1
    for at in range(len(order)):
        e = order[at]
        a, b, c, d, h, i = strains[e]
        # Cofactors of the symmetric [[a, b, c], [b, d, h], [c, h, i]].
        aa, ab, ac = d * i - h * h, c * h - b * i, b * h - c * d
        dd, dh, ii = a * i - c * c, b * c - a * h, a * d - b * b
        determinant = a * aa + b * ab + c * ac
        weights[at] = stiff_volumes[e] * determinant
        if not determinant > 0.0:
            worst = e
            continue
        for corner in range(4):
            x, y, z = rest_gradients[e, corner]
            gradients[at, corner, 0] = (x * aa + y * ab + z * ac) / determinant
            gradients[at, corner, 1] = (x * ab + y * dd + z * dh) / determinant
            gradients[at, corner, 2] = (x * ac + y * dh + z * ii) / determinant
    return worst


@njit(cache=True)
def _strain_jacobian(
    elastic: Array, inverses: Array, gradients: Array, energies: Array, model: int, mu: Array, lam: Array
) -> Array:
    """Values (m, 6, 12), by Wang 2021 Eq. B.6 to B.8 in terms of Q = |Fp| P Fp^-T."""
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
