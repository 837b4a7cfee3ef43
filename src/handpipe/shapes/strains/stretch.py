"""The logarithm of the stretch of a deformation gradient, and its derivative.

F = R U with U symmetric. Plastic strains are compared, smoothed and interpolated through log U: it does not
depend on rotations, it is minus infinity where a tet collapses, and the exponential of any combination is
positive definite.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array
from handpipe.fem.elements import plasticity
from handpipe.mesh.tets import TetMesh, gradient_operator

COUNTS = np.array(
    [1.0, 2.0, 2.0, 1.0, 2.0, 1.0]
)  # how often each of the six stands in the matrix (Wang 2021 Eq. A.2)
LEAST = 1e-6  # squared stretch of a collapsed tet
NEAR = 1e-5  # relative difference of stretches, below which the limit takes the place of the quotient


def log_stretch(f: Array) -> tuple[Array, Array]:
    """Logarithm log U (m, 6) of deformation gradients (m, 3, 3), and its derivative (m, 6, 9) by row-major F.

    With C = F^T F = Q diag(c) Q^T, d log U = Q (G o Q^T dC Q) Q^T, G_ij = (log c_i - log c_j) / (2 (c_i -
    c_j)): the Sylvester equation of Wang 2021 Eq. 5.24 written in the eigenvectors, for the logarithm in
    place of the root.
    """
    c, q = np.linalg.eigh(np.swapaxes(f, 1, 2) @ f)
    c = np.maximum(c, LEAST)
    logs = 0.5 * np.log(c)
    value = plasticity.from_matrices((q * logs[:, None]) @ np.swapaxes(q, 1, 2))
    turned = f @ q  # in the eigenvectors, dC = dF^T F + F^T dF
    half = np.einsum("mli,mkj->mijkl", q, turned, optimize=True)
    inner = _divided_differences(c, logs)[..., None, None] * (half + np.swapaxes(half, 1, 2))
    rows, columns = plasticity.ROWS, plasticity.COLUMNS
    pairs = q[:, rows][:, :, :, None] * q[:, columns][:, :, None, :]
    return value, pairs.reshape(-1, 6, 9) @ inner.reshape(-1, 9, 9)


def _divided_differences(c: Array, logs: Array) -> Array:
    """(logs_i - logs_j) / (c_i - c_j) as (m, 3, 3), logs = log(c) / 2, or its limit where they are near."""
    difference = c[:, :, None] - c[:, None]
    mean = 0.5 * (c[:, :, None] + c[:, None])
    near = np.abs(difference) < NEAR * mean
    quotient = (logs[:, :, None] - logs[:, None]) / np.where(near, 1.0, difference)
    return np.where(near, 0.5 / mean, quotient)


class StretchField:
    """Function from vertex positions to the logarithmic stretch log U of every tet.

    Parameters
    ----------
    rest : TetMesh
        Mesh at rest in mm.
    """

    def __init__(self, rest: TetMesh) -> None:
        self.gradient = gradient_operator(rest.vertices, rest.tets)

    def __call__(self, x: Array) -> Array:
        """Logarithmic stretch log U (m, 6) at vertices (n, 3)."""
        return log_stretch(self.deformation(x))[0]

    def deformation(self, x: Array) -> Array:
        """Deformation gradients (m, 3, 3) at vertices (n, 3)."""
        return (self.gradient @ x.ravel()).reshape(-1, 3, 3)

    def inverted(self, x: Array) -> int:
        """Number of inverted tets at vertices (n, 3)."""
        return int((np.linalg.det(self.deformation(x)) <= 0).sum())

    def linearise(self, x: Array) -> tuple[Array, sparse.csr_matrix]:
        """Logarithmic stretch log U (m, 6) and its Jacobian (6 m, 3 n) at vertices (n, 3)."""
        value, derivative = log_stretch(self.deformation(x))
        return value, (plasticity.per_tet_operator(derivative) @ self.gradient).tocsr()
