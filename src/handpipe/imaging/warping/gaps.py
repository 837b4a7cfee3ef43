"""A field on voxels continued smoothly into those of which nothing is known."""

from __future__ import annotations

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.linalg import cg

from handpipe.core import Array, BoolArray, ConvergenceError, Int32Array, IntArray

TOLERANCE = 1e-6  # of the residual, relative to that of the first guess
ITERATIONS = 5000  # steps at most


def fill_gaps(values: Array, known: BoolArray, slots: Int32Array, spacing: Array) -> Array:
    """Values (k, d) whose unknown rows are harmonic: each the mean of its neighbours along the axes.

    known (k,): rows to be kept. slots (nx, ny, nz): row of each voxel, -1 outside; across that border nothing
    flows. spacing (3,): voxel size in mm. What touches no known voxel takes values of the nearest one.
    Raises `ConvergenceError` where the iterations do not suffice.
    """
    filled = values.copy()
    if known.all() or not known.any():
        return filled
    filled[~known] = values[_nearest(known, slots, spacing)]
    first, second, weights = _edges(slots, spacing)
    used = ~(known[first] & known[second])
    matrix = _laplacian(first[used], second[used], weights[used], len(known))
    unknown = np.flatnonzero(~known)
    rows = matrix[unknown]
    inner = rows[:, unknown].tocsr()
    load = -rows[:, np.flatnonzero(known)] @ values[known]
    filled[unknown] = _solve(inner, load, filled[unknown])
    return filled


def _nearest(known: BoolArray, slots: Int32Array, spacing: Array) -> IntArray:
    """The row of the nearest known voxel, for each unknown row."""
    unsure = (slots < 0) | ~known[slots]
    places = ndimage.distance_transform_edt(
        unsure, sampling=spacing, return_distances=False, return_indices=True
    )
    nearest = slots[tuple(places)]
    order = slots[slots >= 0]
    out = np.empty(len(known), np.int64)
    out[order] = nearest[slots >= 0]
    return out[~known]


def _edges(slots: Int32Array, spacing: Array) -> tuple[IntArray, IntArray, Array]:
    """Rows of neighbours along the axes, and 1 / distance^2 of each pair, 1 for the shortest."""
    pairs = []
    for axis, size in enumerate(spacing):
        a = np.moveaxis(slots, axis, 0)[:-1].ravel()
        b = np.moveaxis(slots, axis, 0)[1:].ravel()
        both = (a >= 0) & (b >= 0)
        pairs.append((a[both], b[both], np.full(int(both.sum()), (spacing.min() / size) ** 2)))
    first, second, weights = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    return first.astype(np.int64), second.astype(np.int64), weights


def _laplacian(first: IntArray, second: IntArray, weights: Array, count: int) -> sparse.csr_matrix:
    both = np.concatenate([first, second]), np.concatenate([second, first])
    links = sparse.csr_matrix((np.concatenate([weights, weights]), both), shape=(count, count))
    return sparse.csr_matrix(sparse.diags(np.asarray(links.sum(axis=1)).ravel()) - links)


def _solve(matrix: sparse.csr_matrix, load: Array, start: Array) -> Array:
    """Conjugate gradients with the diagonal: gaps are thin, so that few iterations cross them."""
    scale = sparse.diags(1 / np.maximum(matrix.diagonal(), 1e-300))
    found = np.empty_like(start)
    for column in range(start.shape[1]):
        residual = load[:, column] - matrix @ start[:, column]
        limit = TOLERANCE * float(np.linalg.norm(residual))
        solution, failed = cg(matrix, residual, rtol=0.0, atol=max(limit, 1e-12), maxiter=ITERATIONS, M=scale)
        if failed:
            reason = f"{ITERATIONS} iterations do not suffice for {len(load)} voxels"
            raise ConvergenceError(
                "displacement in gaps", reason, "Check the frame's shapes in its VTU files"
            )
        found[:, column] = start[:, column] + solution
    return found
