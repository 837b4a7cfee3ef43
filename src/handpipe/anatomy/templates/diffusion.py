"""Muscle and fat functions: tissue values of curves and skin, diffused between skin and bones.

Abdrashitov 2021, Eq. 1 to 13. Two departures: a constraint counts by the length of its curve inside the tet,
not once a tet, so that the energy is that of a line whatever the mesh; tensors are carried into the volume as
logarithms, so that they stay positive definite.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import skfem
from scipy import sparse
from scipy.sparse.linalg import splu
from skfem.helpers import dot, grad, mul

from handpipe.anatomy.templates.curves import PlacedCurve, PlacedMuscle
from handpipe.anatomy.templates.domain import Domain
from handpipe.core import Array, InputError, IntArray
from handpipe.mesh.surfaces import arclength
from handpipe.mesh.tets import Embedding, Locator, TetMesh

log = logging.getLogger(__name__)

WEIGHT = 50.0  # 1/mm, of curve: alpha of Eq. 10
SAMPLES = 8  # of a curve in the shortest way through a typical tet
DECIMALS = 6  # of functions, which go to about 1: beyond them machines differ, and so would the cuts of tets


class Factorised(Protocol):
    """A factorised matrix."""

    def solve(self, b: Array) -> Array:
        """Solution of A x = b, for b (N,) or (N, k)."""
        ...


Factorise = Callable[[sparse.csr_matrix], Factorised]


def superlu(matrix: sparse.csr_matrix) -> Factorised:
    """SciPy's factor of a symmetric positive definite matrix.

    Parameters
    ----------
    matrix : sparse matrix (N, N)
        Symmetric positive definite matrix.

    Returns
    -------
    Factorised
        Its `solve` gives x of A x = b.
    """
    return splu(
        matrix.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


@dataclass(frozen=True, eq=False)
class Collocation:
    """Curves in a mesh: a point and its tet for each way of a curve through a tet.

    Points (c, 3), tets (c,), lengths (c,) in mm of the ways, tissue (c,), frames and rates as of curves.
    """

    points: Array
    tets: IntArray
    lengths: Array
    tissue: Array
    frames: Array
    rates: Array

    @staticmethod
    def sample(curves: Sequence[PlacedCurve], locator: Locator) -> Collocation:
        """Of a muscle's curves; parts outside the mesh are left out."""
        parts = [_collocated(curve, locator) for curve in curves]
        return Collocation(*(np.concatenate([p[i] for p in parts]) for i in range(6)))

    @property
    def has_spread(self) -> bool:
        """Whether values do not diffuse equally fast in all directions."""
        return not np.allclose(self.rates, 1.0)

    def matrix(self, mesh: TetMesh) -> sparse.csr_matrix:
        """B (c, n) of Eq. 8: values at the points from values at the vertices."""
        return Embedding.in_tets(self.points, mesh, self.tets).matrix(len(mesh.vertices))


def _collocated(curve: PlacedCurve, locator: Locator) -> tuple[Array, IntArray, Array, Array, Array, Array]:
    length = arclength(curve.points)
    step = np.cbrt(6 * np.median(locator.mesh.volumes())) / SAMPLES
    at = np.linspace(0, length[-1], max(int(np.ceil(length[-1] / step)), 2))
    samples = np.column_stack([np.interp(at, length, x) for x in curve.points.T])
    tets = locator.tets(samples)
    start = np.flatnonzero(np.concatenate([[True], tets[1:] != tets[:-1]]))
    end = np.concatenate([start[1:], [len(at)]]) - 1
    inside = tets[start] >= 0
    start, end = start[inside], end[inside]
    middle = (start + end) // 2
    nearest = np.abs(length[None] - at[middle][:, None]).argmin(axis=1)
    tissue = np.interp(at[middle], length, curve.tissue)
    lengths = (end - start + 1) * (at[1] - at[0])
    return samples[middle], tets[middle], lengths, tissue, curve.frames[nearest], curve.rates[nearest]


@dataclass(frozen=True, eq=False)
class Functions:
    """Values (n, k) of the tissue functions at the vertices.

    The fat is the first column; the muscles follow in the order of names.
    """

    names: tuple[str, ...]
    values: Array


def diffuse(
    domain: Domain,
    muscles: Mapping[str, PlacedMuscle],
    fat: float,
    *,
    weight: float = WEIGHT,
    factorise: Factorise = superlu,
) -> Functions:
    """Tissue functions of the fat and each muscle: the solutions of Eq. 10 to 12.

    All muscles without anisotropy, and the fat, share one factor.

    Parameters
    ----------
    domain : Domain
        Tets between skin and bones.
    muscles : mapping of str to PlacedMuscle
        Curves and attachments in mm by muscle.
    fat : float
        Tissue value of the fat at the skin.
    weight : float
        The paper's alpha per mm of curve.
    factorise : callable
        Factors symmetric positive definite matrices, see `superlu`.

    Returns
    -------
    Functions
        Values at the domain's vertices.

    Raises
    ------
    InputError
        For a muscle of which no part is inside the domain.
    """
    mesh, n = domain.mesh, len(domain.mesh.vertices)
    curves = collocations(muscles, Locator(mesh))
    constraints = sparse.csr_matrix((n, n))
    right = {}
    for name, collocation in curves.items():
        at_points = collocation.matrix(mesh)
        weighted = (at_points.T @ sparse.diags(weight * collocation.lengths)).tocsr()
        constraints = constraints + weighted @ at_points
        right[name] = weighted @ collocation.tissue
    free = np.setdiff1d(np.arange(n), domain.skin)
    isotropic = stiffness(mesh)
    values = np.zeros((n, 1 + len(muscles)))
    values[domain.skin, 0] = fat
    common = (isotropic + constraints).tocsr()
    factor = factorise(block(common, free))
    values[free, 0] = factor.solve(-(common @ values[:, 0])[free])
    for column, (name, collocation) in enumerate(curves.items(), start=1):
        own = factor
        if collocation.has_spread:
            tensors = diffusion_tensors(mesh, collocation, isotropic, weight, factorise)
            own = factorise(block((stiffness(mesh, tensors) + constraints).tocsr(), free))
        values[free, column] = own.solve(right[name][free])
        log.info("muscle function %d of %d: %s", column, len(curves), name)
    return Functions(("fat", *curves), np.round(values, DECIMALS))


def collocations(muscles: Mapping[str, PlacedMuscle], locator: Locator) -> dict[str, Collocation]:
    """Each muscle's curves in the mesh; `InputError` for a muscle of which no part is inside."""
    curves = {name: Collocation.sample(muscle.curves, locator) for name, muscle in muscles.items()}
    for name, collocation in curves.items():
        if len(collocation.tets) == 0:
            problem = "no part of it lies between skin and bones"
            raise InputError(
                "diffusion", f"muscles.{name}.curves", problem, "Move its points into the soft tissue"
            )
    return curves


def block(matrix: sparse.csr_matrix, free: IntArray) -> sparse.csr_matrix:
    """Rows and columns of the free vertices."""
    return matrix[free][:, free].tocsr()


def stiffness(mesh: TetMesh, tensors: Array | None = None) -> sparse.csr_matrix:
    """Matrix (n, n) in mm of the form grad u . A grad v (Eq. 13).

    A (m, 3, 3) has one tensor a tet; it is the identity if None.
    """
    vertices, tets = (np.ascontiguousarray(a.T) for a in (mesh.vertices, mesh.tets))
    basis = skfem.Basis(skfem.MeshTet(vertices, tets, sort_t=False), skfem.ElementTetP1(), intorder=0)
    if tensors is None:
        return _isotropic.assemble(basis).tocsr()
    return _anisotropic.assemble(basis, tensor=np.moveaxis(tensors, 0, -1)[..., None]).tocsr()


@skfem.BilinearForm
def _isotropic(u, v, w):  # type: ignore[no-untyped-def]
    return dot(grad(u), grad(v))


@skfem.BilinearForm
def _anisotropic(u, v, w):  # type: ignore[no-untyped-def]
    return dot(mul(w["tensor"], grad(u)), grad(v))


def diffusion_tensors(
    mesh: TetMesh,
    collocation: Collocation,
    isotropic: sparse.csr_matrix,
    weight: float,
    factorise: Factorise = superlu,
) -> Array:
    """Diffusion tensors (m, 3, 3) of the tets (section 3.7).

    They are the tensors of the curves' frames and rates, carried harmonically into the mesh.
    """
    return tensors_through(
        mesh,
        collocation,
        lambda data: spread_from_curves(mesh, collocation, data, isotropic, weight, factorise),
    )


def tensors_through(mesh: TetMesh, collocation: Collocation, spread: Callable[[Array], Array]) -> Array:
    """Diffusion tensors (m, 3, 3): `spread` takes data (c, d) from curves' points to vertices (n, d)."""
    frames = collocation.frames
    at_points = np.swapaxes(frames, 1, 2) @ (np.log(collocation.rates)[:, :, None] * frames)
    logarithm = spread(at_points.reshape(-1, 9)).reshape(-1, 3, 3)
    mean = logarithm[mesh.tets].mean(axis=1)
    rates, axes = np.linalg.eigh(mean)
    return np.asarray((axes * np.exp(rates)[:, None]) @ np.swapaxes(axes, 1, 2))


def spread_from_curves(
    mesh: TetMesh,
    collocation: Collocation,
    data: Array,
    isotropic: sparse.csr_matrix,
    weight: float,
    factorise: Factorise = superlu,
) -> Array:
    """Harmonic functions (n, d) that take data (c, d) at the curves' points, with natural boundaries."""
    at_points = collocation.matrix(mesh)
    weighted = (at_points.T @ sparse.diags(weight * collocation.lengths)).tocsr()
    factor = factorise((isotropic + weighted @ at_points).tocsr())
    return np.stack([factor.solve(column) for column in (weighted @ data).T], axis=1)
