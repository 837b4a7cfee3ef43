"""What is left between scan and skin as a smooth field of displacements, which keeps the scan's detail."""

from __future__ import annotations

import igl
import numpy as np
from scipy import sparse

from handpipe.core import Array
from handpipe.fem.linear import factorise
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.skeleton.scan_alignment.image_skin import ImageSkin
from handpipe.skeleton.scan_alignment.matches import Matches

LENGTH = 3.0  # mm: waves of 2 pi times this length are followed by half
TIED = 0.02  # weight of no displacement at all against the distances
NOISE = 0.2  # mm; distances beyond five times the bulk's are outliers
VOLUME = 0.01  # share of the scan's volume that the alignment may change
ROUNDS = 2  # each with outliers weighted anew


def smooth_offset(scan: Surface, skin: ImageSkin, volume: float) -> Surface:
    """The scan moved by a smooth field onto the skin.

    The field minimises distances to tangent planes and its bending energy along the scan; waves shorter than
    some millimetres stay as they were scanned. The enclosed volume stays near `volume` (mm^3).
    """
    distance, moved = Distance(skin.surface), scan
    mass = np.maximum(vertex_areas(scan), 1e-9)
    bending = _bending(scan, mass)
    total = np.zeros_like(scan.vertices)
    for _ in range(ROUNDS):
        match = Matches.find(moved.vertices, moved.vertex_normals(), distance, skin.trusted)
        weights = mass * match.weights(NOISE)
        right = -match.signed + np.einsum("ij,ij->i", match.normals, total)
        total = _solved(match.normals, weights, right, mass, bending)
        moved = scan.moved(scan.vertices + total)
    return scan.moved(scan.vertices + _within_volume(scan, total, mass, volume))


def vertex_areas(scan: Surface) -> Array:
    """Area (n,) in mm^2 that belongs to each vertex: a third of its triangles'."""
    thirds = np.repeat(scan.triangle_areas() / 3, 3)
    return np.asarray(np.bincount(scan.triangles.ravel(), thirds, len(scan.vertices)), dtype=float)


def _bending(scan: Surface, mass: Array) -> sparse.csr_matrix:
    laplacian = sparse.csr_matrix(igl.cotmatrix(scan.vertices, scan.triangles))
    return (LENGTH**4 * laplacian.T @ sparse.diags(1 / mass) @ laplacian).tocsr()


def _solved(normals: Array, weights: Array, right: Array, mass: Array, bending: sparse.csr_matrix) -> Array:
    """Displacements (n, 3) of least energy: those along the normals by `right` (n,) where weights are."""
    n = len(mass)
    blocks = weights[:, None, None] * normals[:, :, None] * normals[:, None, :]
    data = sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n))
    smooth = bending + TIED * sparse.diags(mass)
    matrix = (data + sparse.kron(smooth, sparse.identity(3))).tocsr()
    found = factorise(matrix).solve(((weights * right)[:, None] * normals).reshape(-1))
    return np.asarray(found).reshape(n, 3)


def _within_volume(scan: Surface, field: Array, mass: Array, volume: float) -> Array:
    """The field, where needed with an offset along the normals that keeps the volume near `volume`."""
    normals = scan.vertex_normals()
    found = scan.volume() + float(mass @ np.einsum("ij,ij->i", normals, field))
    excess = found - np.clip(found, (1.0 - VOLUME) * volume, (1.0 + VOLUME) * volume)
    return field - excess / mass.sum() * normals
