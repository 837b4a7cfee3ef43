"""Constant forces on embedded points."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, InputError


class Pull:
    """Energy -sum f . p of constant forces f on points p = W x.

    Parameters
    ----------
    operator : sparse matrix (k, n)
        W, which takes vertex positions (n, 3) to points (k, 3).
    forces : array (k, 3)
        Forces f in mN.

    Raises
    ------
    InputError
        If a force is not finite.

    References
    ----------
    Zheng 2022 Eq. 11.
    """

    constant = True

    def __init__(self, operator: sp.spmatrix | sp.sparray, forces: Array) -> None:
        if not np.all(np.isfinite(forces)):
            raise InputError("load", "forces", "has a force that is not finite", "Give forces in mN")
        self._load = sp.csr_matrix(operator).T @ np.asarray(forces, dtype=float)
        size = self._load.size
        self._zero = sp.csr_matrix((size, size))

    def value(self, x: Array) -> float:
        """Energy in microjoules: -sum f . p, linear in x."""
        return -float(np.vdot(self._load, x))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3) in mN: minus W^T f, constant."""
        return -self._load

    def force_sizes(self, x: Array) -> Array:
        """Size (n,) in mN of the force on each vertex."""
        return np.asarray(np.sqrt((self._load**2).sum(axis=1)))

    def hessian(self, x: Array, project: bool = False) -> sp.csr_matrix:
        """Second derivative (3n, 3n): zero."""
        return self._zero
