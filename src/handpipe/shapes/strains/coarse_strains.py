"""Smooth strains spanned by few fields, and the rows' system among these alone.

Indicator fields of clusters of tets, made smooth by sweeps of Jacobi with the best dampings: the coarse space
of smoothed aggregation (Vanek, Mandel and Brezina 1996). Smoothness, |L S|^2, is so steep that nearly all
that marks determine of strains is in this space.
"""

from __future__ import annotations

import numpy as np
import pyamg
import scipy.linalg
import scipy.sparse as sp

from handpipe.core import Array
from handpipe.shapes.strains.stretch import COUNTS

SWEEPS = 5  # more make the products dearer, fewer the iterations more
LARGEST = 2.0  # bound of the eigenvalues of D^-1 L: it is a graph's


class CoarseStrains:
    """Fields over clusters of tets, and the inverse of |L S|^2 among them."""

    def __init__(self, laplacian: sp.csr_matrix) -> None:
        """Coarse fields of a `laplacian` (m, m) of tets that faces connect."""
        neighbours = (laplacian @ laplacian).tocsr()
        fields = pyamg.aggregation.standard_aggregation(neighbours)[0].astype(float)
        scaled = sp.diags_array(1 / laplacian.diagonal()) @ laplacian
        for root in _roots(SWEEPS):
            fields = fields - (scaled @ fields) / root
        # All of them together are the constant, which L does not see.
        fields = sp.csr_matrix(fields)[:, 1:]
        rough = laplacian @ fields
        self._lower = np.linalg.cholesky((rough.T @ rough).toarray())
        self._fields = fields.T.tocsr()
        self._sums = np.asarray(fields.sum(axis=0)).ravel()

    def gram(self, pulls: sp.csr_matrix, reactions: Array) -> Array:
        """Z V (V^T B V)^-1 V^T Z^T (k, k), its lower triangle.

        V: the fields with their means taken off; Z^T: pulls (6m, 3n) times reactions (3n, k); B: the Hessian
        of |L S|^2 / 2.
        """
        count = reactions.shape[1]
        gram = np.zeros((count, count), order="F")
        if len(self._sums) == 0:
            return gram
        for number, times in enumerate(COUNTS):
            own = pulls[number::6]
            mean = np.asarray(own.mean(axis=0)).ravel()
            along = (self._fields @ own) @ reactions - np.outer(self._sums, mean @ reactions)
            along = scipy.linalg.solve_triangular(self._lower, along, lower=True, check_finite=False)
            gram = scipy.linalg.blas.dsyrk(
                1.0 / times, along, beta=1.0, c=gram, trans=1, lower=1, overwrite_c=1
            )
        return gram


def _roots(count: int) -> Array:
    """Of the polynomial p of that degree, p(0) = 1, for which |z p(z)| is least on [0, LARGEST] (count,).

    z p(z) is the Chebyshev polynomial of the next degree, moved until its first root is zero.
    """
    angles = (2 * np.arange(count + 1) + 1) * np.pi / (2 * count + 2)
    roots = np.cos(angles)
    return LARGEST * (roots[:-1] - roots[-1]) / (1 - roots[-1])
