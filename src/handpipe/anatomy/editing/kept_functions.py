"""Tissue functions of curves that change, by the domain's factor that is kept.

K is the Laplacian of the free vertices, B the matrix of all curves (Eq. 8), W the weights of its rows.
`diffuse` solves (K + B^T W B) f = B^T W d for the tissue values d of a muscle, which are zero at the other
curves. By the identity (K + B^T W B)^-1 B^T W = K^-1 B^T S^-1 with S = W^-1 + B K^-1 B^T, the functions are

    f = K^-1 B^T S^-1 d.

S has one row a way of a curve through a tet: a few hundred. K does not depend on the curves. An edit changes
the rows of one muscle in S, and each function then is one solve by the factor of K. The fat's function is
`fat` times one minus the function whose tissue value is 1 at all curves, since constants are harmonic.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve

from handpipe.anatomy.editing.greens_matrix import GreensMatrix
from handpipe.anatomy.templates.curves import PlacedMuscle
from handpipe.anatomy.templates.diffusion import (
    WEIGHT,
    Collocation,
    Factorise,
    Functions,
    block,
    collocations,
    diffusion_tensors,
    stiffness,
    superlu,
)
from handpipe.anatomy.templates.domain import Domain
from handpipe.core import Array
from handpipe.mesh.tets import Locator


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A muscle in the mesh; the matrix of its own diffusion where it has spread."""

    muscle: PlacedMuscle
    collocation: Collocation
    matrix: sparse.csr_matrix
    own: sparse.csr_matrix | None


@dataclass(frozen=True, eq=False)
class _Column:
    """A function's data (c,) at the curves, its own matrix if it has spread, and its values (n,)."""

    data: Array
    own: sparse.csr_matrix | None
    values: Array


class KeptFunctions:
    """Tissue functions of muscles that are edited: the same as of `diffuse`, without its rounding.

    Muscles that are the same objects as in the call before are not looked at again. A muscle with spread has
    a matrix of its own, which is factorised whenever any curve changes.

    Parameters
    ----------
    domain : Domain
        Tets between skin and bones.
    weight : float
        The paper's alpha per mm of curve.
    factorise : callable
        Factors symmetric positive definite matrices, see `superlu`.
    """

    def __init__(self, domain: Domain, *, weight: float = WEIGHT, factorise: Factorise = superlu) -> None:
        self.domain = domain
        self._weight, self._factorise = weight, factorise
        self._greens = GreensMatrix(domain, factorise)
        self._locator = Locator(domain.mesh)
        self._drawn: dict[str, _Drawn] = {}
        self._columns: dict[str, _Column] = {}
        self._constraints: tuple[Array, Array] = (np.zeros((0, 3)), np.zeros(0))

    def of(self, muscles: Mapping[str, PlacedMuscle], fat: float) -> Functions:
        """Functions of the fat and each muscle.

        Parameters
        ----------
        muscles : mapping of str to PlacedMuscle
            Curves in mm by muscle.
        fat : float
            Tissue value of the fat at the skin.

        Returns
        -------
        Functions
            Values at the domain's vertices.

        Raises
        ------
        InputError
            For a muscle of which no part is inside the domain.
        """
        drawn = self._draw(muscles)
        names = ("fat", *drawn)
        values = np.zeros((len(self.domain.mesh.vertices), len(names)))
        values[:, 0] = fat
        if drawn:
            units = self._units(drawn)
            values[:, 0] -= fat * units[:, 0]
            values[:, 1:] = units[:, 1:]
        self._drawn = drawn
        return Functions(names, values)

    def _draw(self, muscles: Mapping[str, PlacedMuscle]) -> dict[str, _Drawn]:
        new = {n: m for n, m in muscles.items() if n not in self._drawn or self._drawn[n].muscle is not m}
        found = {name: self._in_mesh(new[name], c) for name, c in collocations(new, self._locator).items()}
        return {name: found.get(name) or self._drawn[name] for name in muscles}

    def _in_mesh(self, muscle: PlacedMuscle, collocation: Collocation) -> _Drawn:
        mesh, own = self.domain.mesh, None
        if collocation.has_spread:
            tensors = diffusion_tensors(mesh, collocation, stiffness(mesh), self._weight, self._factorise)
            own = stiffness(mesh, tensors)
        return _Drawn(muscle, collocation, collocation.matrix(mesh), own)

    def _units(self, drawn: Mapping[str, _Drawn]) -> Array:
        """Values (n, 1 + k): tissue value 1 at all curves, then each muscle's tissue values at its curves."""
        at_points = sparse.vstack([d.matrix for d in drawn.values()], format="csr")
        weights = np.concatenate([self._weight * d.collocation.lengths for d in drawn.values()])
        data = _data(drawn)
        places = np.concatenate([d.collocation.points for d in drawn.values()])
        if not _equal(self._constraints, (places, weights)):
            self._columns, self._constraints = {}, (places, weights)
        own = {"fat": None} | {name: d.own for name, d in drawn.items()}
        # Where curves and a column's data are the same, so is the solution: only tissue values changed.
        self._columns = {
            name: column
            for name, column in self._columns.items()
            if name in data and column.own is own[name] and np.array_equal(column.data, data[name])
        }
        stale = [name for name in data if name not in self._columns]
        shared = [name for name in stale if own[name] is None]
        found = {
            name: self._with_spread(own[name], at_points, weights, data[name])
            for name in stale
            if own[name] is not None
        }
        if shared:
            right = np.column_stack([data[name] for name in shared])
            found |= zip(shared, self._solved(at_points, weights, right).T, strict=True)
        self._columns |= {name: _Column(data[name], own[name], values) for name, values in found.items()}
        return np.column_stack([self._columns[name].values for name in data])

    def _solved(self, at_points: sparse.csr_matrix, weights: Array, data: Array) -> Array:
        """K^-1 B^T S^-1 d for data (c, k)."""
        vertices = np.unique(at_points.indices)
        near = at_points[:, vertices]
        system = near @ (near @ self._greens.between(vertices)).T + np.diag(1 / weights)
        loads = cho_solve(cho_factor(system), data)
        return self._greens.solve(at_points.T @ loads)

    def _with_spread(
        self, own: sparse.csr_matrix, at_points: sparse.csr_matrix, weights: Array, data: Array
    ) -> Array:
        """The whole system of a muscle with spread."""
        weighted = at_points.T @ sparse.diags(weights)
        free = self._greens.free
        factor = self._factorise(block((own + weighted @ at_points).tocsr(), free))
        values = np.zeros(len(self.domain.mesh.vertices))
        values[free] = factor.solve((weighted @ data)[free])
        return values


def _data(drawn: Mapping[str, _Drawn]) -> dict[str, Array]:
    """Values (c,) at the points of curves: 1 for the fat, tissue values at its own curves for a muscle."""
    counts = [len(d.collocation.tets) for d in drawn.values()]
    ends = np.cumsum(counts)
    found = {"fat": np.ones(ends[-1])}
    for (name, muscle), end, count in zip(drawn.items(), ends, counts, strict=True):
        found[name] = np.zeros(ends[-1])
        found[name][end - count : end] = muscle.collocation.tissue
    return found


def _equal(a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
