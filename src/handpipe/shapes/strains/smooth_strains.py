"""Smooth fields of log-strains over the tets of a mesh.

The plastic strain Laplacian acts on each of the six numbers alone (Wang 2021 Eq. A.2), so one scalar
eigenproblem serves all six. Its least eigenvectors, from the constant one on, span the fields that the
smoothness term of Wang 2021 Eq. 5.3 allows: fields outside of it are damped by at least the last eigenvalue
squared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from handpipe.core import Array, IntArray
from handpipe.mesh.tets import tet_laplacian
from handpipe.shapes.strains.stretch import COUNTS

TRACE = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 1.0])  # the trace of a strain, as weights of its six numbers

DENSE = 400  # tets up to which a dense eigendecomposition is used


@dataclass(frozen=True)
class SmoothStrains:
    """fields (m, k) orthonormal over tets, smoothest first; values (k,) of the Laplacian."""

    fields: Array
    values: Array

    @staticmethod
    def compute(tets: IntArray, count: int) -> SmoothStrains:
        """The `count` smoothest fields over connected tets (m, 4); at most m."""
        laplacian = tet_laplacian(tets)
        m = laplacian.shape[0]
        count = min(count, m)
        if m <= max(DENSE, 2 * count):
            values, fields = np.linalg.eigh(laplacian.toarray())
        else:
            start = np.random.default_rng(0).standard_normal(m)
            shifted = laplacian + 1e-8 * sparse.identity(m)  # the constant field has eigenvalue zero
            values, fields = eigsh(shifted.tocsc(), count, sigma=0.0, v0=start)
        order = np.argsort(values)[:count]
        values, fields = np.maximum(values[order], 0.0), fields[:, order]
        values[0], fields[:, 0] = 0.0, 1 / np.sqrt(m)
        return SmoothStrains(fields, values)

    def first(self, count: int) -> SmoothStrains:
        """The smoothest of these."""
        return SmoothStrains(self.fields[:, :count], self.values[:count])

    def __call__(self, coefficients: Array) -> Array:
        """Log-strains (m, 6) of coefficients (k, 6)."""
        return self.fields[:, : len(coefficients)] @ coefficients

    def roughness(self, coefficients: Array, volume: float = 0.0) -> float:
        """|L S|^2 + volume |tr S|^2, off-diagonal numbers counted twice."""
        values = self.values[: len(coefficients)] ** 2 @ (coefficients**2 @ COUNTS)
        return float(values + volume * ((coefficients @ TRACE) ** 2).sum())

    def prior(self, volume: float = 0.0) -> Array:
        """Matrix (6 k, 6 k) of `roughness` as a quadratic form."""
        matrix = np.diag(np.outer(self.values**2, COUNTS).ravel())
        return matrix + volume * np.kron(np.eye(len(self.values)), np.outer(TRACE, TRACE))

    def project(self, log_strains: Array) -> Array:
        """Coefficients (k, 6) nearest to log-strains (m, 6)."""
        return self.fields.T @ log_strains

    def times(self, derivative: sparse.csr_matrix) -> Array:
        """Derivative (r, 6 m) by log-strains as a dense derivative (r, 6 k) by coefficients."""
        by_number = [derivative[:, c::6] @ self.fields for c in range(6)]
        return np.stack(by_number, axis=2).reshape(derivative.shape[0], -1)
