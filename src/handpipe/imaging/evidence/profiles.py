"""Intensity along the normals of a surface, and smooth fields on a surface from uncertain measurements."""

from __future__ import annotations

import igl
import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import cg

from handpipe.core import Array, ConvergenceError, IntArray
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface, averaging

BLUR = 0.5  # voxels: deviation of a voxel's box, 0.29, and of trilinear interpolation, 0.41, together
NOTHING = 1e-100  # mm; the squares of smaller numbers underflow, and conjugate gradients divide by them


def sample_profiles(volume: Volume, points: Array, directions: Array, offsets: Array) -> Array:
    """Intensities of an image along lines.

    Parameters
    ----------
    volume : Volume
        Image.
    points : array (n, 3)
        Origin of each line, in world mm.
    directions : array (n, 3)
        Unit direction of each line.
    offsets : array (m,)
        Distances of the samples from the origins in mm, negative against the direction.

    Returns
    -------
    array (n, m)
        Trilinear values; beyond the grid, the value at its border.
    """
    return volume.sample(points[:, None] + offsets[:, None] * directions[:, None])


def graph_laplacian(triangles: IntArray, count: int) -> sp.csr_matrix:
    """Combinatorial Laplacian (n, n) of a triangle mesh's edges, rows divided by the mean degree."""
    i = triangles.ravel()
    j = np.roll(triangles, -1, axis=1).ravel()
    adjacency = sp.coo_matrix((np.ones(len(i)), (i, j)), shape=(count, count)).tocsr()
    adjacency = ((adjacency + adjacency.T) > 0).astype(float)
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return ((sp.diags(degree) - adjacency) / max(degree.mean(), 1.0)).tocsr()


def smooth_field(
    laplacian: sp.csr_matrix,
    measured: Array,
    confidence: Array,
    stiffness: float,
    scale: float,
    iterations: int = 8,
    upper_scale: float | None = None,
) -> tuple[Array, Array]:
    """Smooth field (n,) near measurements (n,) with confidences (n,) in [0, 1], and the weights kept (n,).

    Minimises sum_i c_i rho(d_i - u_i) + stiffness u^T L u with the Geman-McClure penalty rho of width `scale`
    by reweighting, so that measurements which disagree with their neighbours lose their weight. `upper_scale`
    is the width for measurements above the field, where errors are one-sided.
    """
    stiff = (stiffness * laplacian + 1e-6 * sp.identity(len(measured))).tocsr()
    weights = confidence.astype(float)
    field = measured
    for _ in range(iterations):
        field = _solved(stiff + sp.diags(weights), weights * measured, field)
        residual = measured - field
        width = scale if upper_scale is None else np.where(residual > 0, upper_scale, scale)
        weights = confidence / (1 + (residual / width) ** 2) ** 2
    return field, weights


def _solved(matrix: sp.csr_matrix, right: Array, start: Array) -> Array:
    """Solution (n,) of a positive system by conjugate gradients, scaled by its diagonal."""
    if np.abs(right).max(initial=0.0) < NOTHING:
        return np.zeros_like(right)
    scaling = sp.diags(1 / matrix.diagonal())
    solution, stalled = cg(matrix, right, x0=start, rtol=1e-8, atol=0.0, M=scaling)
    if stalled:
        raise ConvergenceError("the smooth field", f"{stalled} iterations were not enough")
    return np.asarray(solution)


def summed_curvature(surface: Surface, smoothing: int = 4) -> Array:
    """Sum of the principal curvatures (n,) in 1/mm, positive where convex, averaged over a few rings.

    The gradient of area along the normal, by the cotangent Laplacian, over area.
    """
    growth = -np.einsum(
        "ij,ij->i",
        igl.cotmatrix(surface.vertices, surface.triangles) @ surface.vertices,
        surface.vertex_normals(),
    )
    area = np.bincount(surface.triangles.ravel(), np.repeat(surface.triangle_areas() / 3, 3), len(growth))
    mean = averaging(surface)
    for _ in range(smoothing):
        growth, area = 0.5 * (growth + mean @ growth), 0.5 * (area + mean @ area)
    return growth / np.maximum(area, 1e-12)
