"""Speed of assembly: energy, gradient and Hessian of a body under plastic strain.

`python -m benchmarks.fem.assembly` prints the figures; NUMBA_NUM_THREADS sets how many threads "2" means.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import numba
import numpy as np
import scipy.sparse as sp
import skfem
from numba import njit, prange
from skfem.helpers import ddot, det, grad

from benchmarks.fem.skfem_newton import NeoHookean, internal_force
from benchmarks.fem.skfem_newton import _stiffness as pair_stiffness
from handpipe.core import Array, IntArray
from handpipe.fem.elements import Material, plasticity
from handpipe.fem.potentials import Elastic

Figures = dict[str, dict[str, float | str]]

CELLS = (61, 25, 25)  # of a beam 4 x 1 x 1, 6 tets each: 228,750 tets
YOUNG, POISSON = 1.0, 0.45
MATERIAL = Material(YOUNG, POISSON)
REPEATS = 5


def measure() -> Figures:
    """Figures name -> {value, unit}: medians on a deformed beam of 228,750 tets with random plastic strains.

    `assembly_ms_230k` is value + gradient + plain Hessian, each asked for once, as the solver does;
    `assembly_floor_ms_230k` the time to read what they read and to write what they write, on the same
    threads; `assembly_ratio_skfem` scikit-fem's time for energy, residual and tangent of the same
    form (numpy, one quadrature point) over ours, side by side. The results are compared before they are
    timed.
    """
    vertices, tets, strains, x = deformed_beam()
    figures: Figures = {}
    several = max(numba.get_num_threads(), 1)
    body = Elastic(vertices, tets, MATERIAL, strains)
    reference = Reference(vertices, tets, strains, several)
    _compare(body, reference, x)
    figures["assembly_tets_230k"] = _figure(len(tets), "1")
    figures["assembly_threads"] = _figure(several, "1")
    runs = _seconds(lambda: assemble(body, x), REPEATS)
    skfem_seconds = _median(lambda: reference.assemble(x), 3)
    runs += _seconds(lambda: assemble(body, x), REPEATS)  # on both sides: the machine's load comes and goes
    ours = float(np.median(runs))
    figures["assembly_ms_230k"] = _figure(1e3 * ours, "ms")
    for name, work in (
        ("value", lambda: body.value(x)),
        ("gradient", lambda: body.gradient(x)),
        ("hessian", lambda: body.hessian(x)),
        ("projected_hessian", lambda: body.hessian(x, project=True)),
        ("new_strains", lambda: body.with_strains(strains)),
    ):
        figures[f"assembly_{name}_ms_230k"] = _figure(1e3 * _median(work, REPEATS), "ms")
    figures["assembly_floor_ms_230k"] = _figure(1e3 * _median(_movement(body, x), REPEATS), "ms")
    figures["assembly_skfem_ms_230k"] = _figure(1e3 * skfem_seconds, "ms")
    figures["assembly_ratio_skfem"] = _figure(skfem_seconds / ours, "1")
    build = _median(lambda: Elastic(vertices, tets, MATERIAL, strains), 3)
    figures["assembly_build_ms_230k"] = _figure(1e3 * build, "ms")
    numba.set_num_threads(1)
    try:
        alone = Elastic(vertices, tets, MATERIAL, strains)
        figures["assembly_ms_230k_one_thread"] = _figure(
            1e3 * _median(lambda: assemble(alone, x), REPEATS), "ms"
        )
    finally:
        numba.set_num_threads(several)
    return figures


def deformed_beam(cells: tuple[int, int, int] = CELLS) -> tuple[Array, IntArray, Array, Array]:
    """Vertices, tets, plastic strains and positions of a beam 4 x 1 x 1 that is turned and shaken."""
    axes = (np.linspace(0, size, n + 1) for size, n in zip((4, 1, 1), cells, strict=True))
    mesh = skfem.MeshTet.init_tensor(*axes)
    vertices, tets = mesh.p.T.copy(), mesh.t.T.astype(np.int64)
    corners = vertices[tets]
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    rng = np.random.default_rng(0)
    strains = plasticity.exp(0.1 * rng.normal(size=(len(tets), 6)))
    angle = np.pi / 4 * vertices[:, 0]
    y, z = vertices[:, 1] - 0.5, vertices[:, 2] - 0.5
    cosine, sine = np.cos(angle), np.sin(angle)
    x = np.stack([vertices[:, 0], cosine * y - sine * z, sine * y + cosine * z], axis=1)
    return vertices, tets, strains, x + 0.05 / cells[1] * rng.normal(size=x.shape)


def assemble(body: Elastic, x: Array) -> tuple[float, Array, sp.csr_matrix]:
    """Energy, gradient and Hessian, as a solver asks for them."""
    return body.value(x), body.gradient(x), body.hessian(x)


class Reference:
    """The same energy in scikit-fem: linear tets, one quadrature point, forms in numpy on as many threads.

    Stress and tangent are pulled back to the rest shape once, so that a pair of shape functions costs no more
    than without plastic strain.
    """

    def __init__(self, vertices: Array, tets: IntArray, strains: Array, threads: int) -> None:
        mesh = skfem.MeshTet(vertices.T.copy(), tets.T.copy())
        self.basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()), intorder=0)
        self.material = NeoHookean(YOUNG, POISSON)
        self.inverse = plasticity.inverse_matrices(strains).transpose(1, 2, 0)[..., None]
        self.volume = plasticity.determinants(strains)[:, None]
        self.rest = vertices
        self.force = skfem.LinearForm(internal_force.form, nthreads=threads)
        self.stiffness = skfem.BilinearForm(pair_stiffness, nthreads=threads)

    def assemble(self, x: Array) -> tuple[float, Array, sp.csr_matrix]:
        """Energy, residual (3n,) and tangent in scikit-fem's order of unknowns."""
        f = grad(self.basis.interpolate(self.unknowns(x - self.rest))) + np.eye(3)[:, :, None, None]
        f = np.einsum("ik...,kj...->ij...", f, self.inverse)
        energy = float((self._density(f) * self.volume * self.basis.dx).sum())
        stress = np.einsum("ik...,jk...->ij...", self.volume * self.material.stress(f), self.inverse)
        tangent = np.einsum("iqkp...,jq...->ijkp...", self.volume * self.material.tangent(f), self.inverse)
        tangent = np.einsum("ijkp...,lp...->ijkl...", tangent, self.inverse)
        residual = self.force.assemble(self.basis, stress=stress)
        return energy, residual, self.stiffness.assemble(self.basis, tangent=tangent)

    def unknowns(self, field: Array) -> Array:
        """A vector field (n, 3) at the vertices in scikit-fem's order."""
        out = np.empty(field.size)
        out[self.basis.nodal_dofs.T] = field
        return out

    def _density(self, f: Array) -> Array:
        """Energy density, zero at rest."""
        mu, lam, alpha = self.material.mu, self.material.lam, self.material.alpha
        invariant, rest = ddot(f, f), 0.5 * lam * (1 - alpha) ** 2
        shear = 0.5 * mu * (invariant - 3 - np.log((invariant + 1) / 4))
        return shear + 0.5 * lam * (det(f) - alpha) ** 2 - rest


def _compare(body: Elastic, reference: Reference, x: Array) -> None:
    """Raise where the two disagree: a time means nothing for another result."""
    value, gradient, hessian = assemble(body, x)
    energy, residual, tangent = reference.assemble(x)
    probe = np.random.default_rng(1).normal(size=x.shape)
    product, expected = hessian @ probe.ravel(), tangent @ reference.unknowns(probe)
    order = reference.basis.nodal_dofs.T.ravel()
    np.testing.assert_allclose(value, energy, rtol=1e-10)
    np.testing.assert_allclose(gradient.ravel(), residual[order], atol=1e-10 * np.abs(residual).max())
    np.testing.assert_allclose(product, expected[order], atol=1e-10 * np.abs(expected).max())


def _movement(body: Elastic, x: Array) -> Callable[[], float]:
    """Read the arrays of the three passes as often as they are read there, write the gradient and values."""
    cells = body._body
    numbers = [x.ravel(), cells.gradients.ravel(), cells.weights, cells.mu, cells.lam]
    everything = np.concatenate(numbers)
    integers = np.concatenate([body.pattern.slots, body.pattern.strides, body.pattern.indptr])
    tets, out = cells.tets.ravel(), np.empty(x.size + len(body.pattern.indices))

    def move() -> float:
        total = 0.0
        for _ in range(3):
            total += _read(everything) + _read(tets)
        total += _read(integers)
        _write(out, total)
        return total

    return move


@njit(parallel=True)
def _read(values):  # type: ignore[no-untyped-def]
    total = 0.0
    for part in prange(64):
        share = values[len(values) * part // 64 : len(values) * (part + 1) // 64]
        sums = np.zeros(8)  # independent sums: memory is to be the limit, not the latency of addition
        for k in range(0, len(share) - 7, 8):
            for lane in range(8):
                sums[lane] += share[k + lane]
        total += sums.sum()
    return total


@njit(parallel=True)
def _write(out, value):  # type: ignore[no-untyped-def]
    for k in prange(len(out)):
        out[k] = value


def _seconds(work: Callable[[], object], repeats: int) -> list[float]:
    """Seconds of each of the runs after one to warm up."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return times


def _median(work: Callable[[], object], repeats: int) -> float:
    return float(np.median(_seconds(work, repeats)))


def _figure(value: float, unit: str) -> dict[str, float | str]:
    return {"value": float(value), "unit": unit}


if __name__ == "__main__":
    print(json.dumps(measure(), indent=2))
