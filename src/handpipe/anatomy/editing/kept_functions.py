"""Tissue functions of curves that change, by the domain's factor that is kept.

An edit changes the rows of one muscle in the small matrix S of `constrained`. Each function then is one solve
by the factor of the Laplacian, which does not depend on the curves. The fat's function is `fat` times one
minus the function whose tissue value is 1 at all curves, since constants are harmonic.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from handpipe.anatomy.editing.constrained import Constrained
from handpipe.anatomy.editing.greens_matrix import GreensMatrix
from handpipe.anatomy.editing.spread_matrices import SpreadMatrices
from handpipe.anatomy.templates.curves import PlacedMuscle
from handpipe.anatomy.templates.diffusion import (
    WEIGHT,
    Collocation,
    Factorise,
    Functions,
    collocations,
    stiffness,
    superlu,
)
from handpipe.anatomy.templates.domain import Domain
from handpipe.core import Array
from handpipe.mesh.tets import Locator

FAT = ""  # name of the fat's column, which no muscle has


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

    def fits(self, data: Array, own: sparse.csr_matrix | None) -> bool:
        return self.own is own and np.array_equal(self.data, data)


class KeptFunctions:
    """Tissue functions of muscles that are edited: the same as of `diffuse`, without its rounding.

    Muscles that are the same objects as in the call before are not looked at again. A muscle with spread has
    a matrix of its own; its function is found by conjugate gradients.

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
        self._laplacian = stiffness(domain.mesh)
        self._greens = GreensMatrix(self._laplacian, domain.skin, factorise)
        self._spread: SpreadMatrices | None = None
        self._before: dict[str, Array] = {}
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
        own = None
        if collocation.has_spread:
            self._spread = self._spread or SpreadMatrices(
                self.domain.mesh, self._laplacian, self._weight, self._factorise
            )
            own = self._spread.of(collocation)
        return _Drawn(muscle, collocation, collocation.matrix(self.domain.mesh), own)

    def _units(self, drawn: Mapping[str, _Drawn]) -> Array:
        """Values (n, 1 + k): tissue value 1 at all curves, then each muscle's tissue values at its curves."""
        at_points = sparse.vstack([d.matrix for d in drawn.values()], format="csr")
        weights = np.concatenate([self._weight * d.collocation.lengths for d in drawn.values()])
        places = np.concatenate([d.collocation.points for d in drawn.values()])
        if not _equal(self._constraints, (places, weights)):
            self._columns, self._constraints = {}, (places, weights)
        wanted = _wanted(drawn)
        # Where curves and a column's data are the same, so is the solution: only tissue values changed.
        self._columns = {n: c for n, c in self._columns.items() if n in wanted and c.fits(*wanted[n])}
        stale = {name: given for name, given in wanted.items() if name not in self._columns}
        if stale:
            self._columns |= self._solved(Constrained(self._greens, at_points, weights), stale)
        return np.column_stack([self._columns[name].values for name in wanted])

    def _solved(
        self, system: Constrained, stale: Mapping[str, tuple[Array, sparse.csr_matrix | None]]
    ) -> dict[str, _Column]:
        """Columns by name for data (c,) and the muscle's own matrix, if it has one."""
        shared = [name for name, (_, own) in stale.items() if own is None]
        found: dict[str, Array] = {}
        if shared:
            values = system.functions(np.column_stack([stale[name][0] for name in shared]))
            found |= zip(shared, values.T, strict=True)
        for name, (data, own) in stale.items():
            if own is not None:
                found[name] = system.function_of(own, data, self._before.get(name))
        self._before |= found
        return {name: _Column(*stale[name], values) for name, values in found.items()}


def _wanted(drawn: Mapping[str, _Drawn]) -> dict[str, tuple[Array, sparse.csr_matrix | None]]:
    """Data (c,) at the points of curves, 1 for the fat and zero at other muscles' curves; own matrices."""
    ends = np.cumsum([len(d.collocation.tets) for d in drawn.values()])
    found: dict[str, tuple[Array, sparse.csr_matrix | None]] = {FAT: (np.ones(ends[-1]), None)}
    for (name, muscle), end in zip(drawn.items(), ends, strict=True):
        tissue = np.zeros(ends[-1])
        tissue[end - len(muscle.collocation.tets) : end] = muscle.collocation.tissue
        found[name] = tissue, muscle.own
    return found


def _equal(a: tuple[Array, Array], b: tuple[Array, Array]) -> bool:
    return all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
