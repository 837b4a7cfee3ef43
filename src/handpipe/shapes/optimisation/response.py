"""How an equilibrium follows its plastic strains, to first order.

Differentiating f(S, x) = 0 gives dx = J dS with J = -K^-1 df/dS (Wang 2021 Eq. 5.10). J is dense and never
formed: `motion` and `pull` are J and its transpose at the price of one solve each with the factorised
stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, ConvergenceError
from handpipe.fem.elements import plasticity
from handpipe.fem.linear import DeflatedFactor, NotPositiveDefinite, SingularMatrix, factorise
from handpipe.fem.potentials import Elastic, Potential, Sum
from handpipe.shapes.strains.strain_frame import StrainFrame

WHAT = "Shape from plastic strains"


class Solver(Protocol):
    """The inverse of a symmetric matrix."""

    def solve(self, b: Array) -> Array:
        """Solution for b (N,) or (N, k)."""
        ...


class Response:
    """The derivative J (3n, 6m) of the equilibrium x by the log-strains, and the loose rigid motions.

    loose (3n, r): rigid motions without resistance. They span the nullspace of the stiffness (Wang 2021
    Nullspace Lemma); J is the pseudo-inverse's, and a step adds any of them.
    """

    def __init__(
        self,
        body: Elastic,
        external: Sequence[Potential],
        x: Array,
        logs: Array,
        loose: Array,
        frame: StrainFrame | None = None,
    ) -> None:
        """body: with strains exp(logs), logs (m, 6) in a frame; x (n, 3): its equilibrium with `external`."""
        since = logs if frame is None else frame(logs)
        derivative = plasticity.exp_derivative(since)
        if frame is not None:
            derivative = derivative @ frame.operator()
        self.forces = (body.strain_jacobian(x) @ plasticity.per_tet_operator(derivative)).tocsr()
        self.pulls = self.forces.T.tocsr()
        self.loose = loose
        self._inverse = _inverse(Sum([body, *external]).hessian(x), loose)

    def motion(self, change: Array) -> Array:
        """J d (3n,) of a change d (m, 6) of the log-strains."""
        return -self._inverse.solve(self.forces @ change.ravel())

    def pull(self, forces: Array) -> Array:
        """J^T g (m, 6) of forces g (3n,)."""
        return -(self.pulls @ self._inverse.solve(forces)).reshape(-1, 6)

    def reactions(self, rows: sp.csr_matrix) -> Array:
        """-K^-1 A^T (3n, k) of rows A (k, 3n), so that A J = (df/dS^T of it)^T."""
        return -self._inverse.solve(rows.T.toarray())

    def uniform(self) -> Array:
        """Motions (3n, 6) under the six uniform strains."""
        each = np.tile(np.eye(6), (self.forces.shape[1] // 6, 1))
        return -self._inverse.solve(self.forces @ each)


def _inverse(matrix: sp.csr_matrix, loose: Array) -> Solver:
    try:
        if loose.shape[1]:
            return DeflatedFactor(matrix, np.linalg.qr(loose)[0])
        try:
            return factorise(matrix)
        except NotPositiveDefinite:
            return factorise(matrix, positive=False)
    except (SingularMatrix, NotPositiveDefinite) as error:
        raise ConvergenceError(WHAT, f"the stiffness cannot be factorised ({error})") from error
