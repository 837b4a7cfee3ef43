"""What is left between scan and skin as a smooth field of displacements, which keeps the scan's detail."""

from __future__ import annotations

import igl
import numpy as np
from scipy import sparse

from handpipe.core import Array
from handpipe.fem.linear import factorise
from handpipe.mesh.generation import simplified
from handpipe.mesh.surfaces import Distance, Surface, barycentric_matrix
from handpipe.skeleton.scan_alignment.image_skin import ImageSkin
from handpipe.skeleton.scan_alignment.matches import Matches

LENGTH = 3.0  # mm: waves of 2 pi times this length are followed by half
TIED = 0.02  # weight of no displacement at all against the distances
NOISE = 0.2  # mm; distances beyond five times the bulk's are outliers
VOLUME = 0.01  # share of the scan's volume that the alignment may change
CARRIER = 1.5  # mm, edge of the coarser copy of the scan that carries the field
ROUNDS = 2  # each with outliers weighted anew


def smooth_offset(scan: Surface, skin: ImageSkin, volume: float) -> Surface:
    """The scan moved by a smooth field onto the skin.

    The field minimises distances to tangent planes and its bending energy along the scan; waves shorter than
    some millimetres stay as they were scanned. The enclosed volume stays near `volume` (mm^3).
    """
    distance, moved = Distance(skin.surface), scan
    mass = np.maximum(vertex_areas(scan), 1e-9)
    carrier = simplified(scan, CARRIER)
    carried = _carried(scan, carrier)
    smooth = _smooth(carrier)
    total = np.zeros_like(scan.vertices)
    for _ in range(ROUNDS):
        match = Matches.find(moved.vertices, moved.vertex_normals(), distance, skin.trusted)
        weights = mass * match.weights(NOISE)
        right = -match.signed + np.einsum("ij,ij->i", match.normals, total)
        total = carried @ _solved(match.normals, weights, right, carried, smooth)
        moved = scan.moved(scan.vertices + total)
    return scan.moved(scan.vertices + _within_volume(scan, total, mass, volume))


def vertex_areas(scan: Surface) -> Array:
    """Area (n,) in mm^2 that belongs to each vertex: a third of its triangles'."""
    thirds = np.repeat(scan.triangle_areas() / 3, 3)
    return np.asarray(np.bincount(scan.triangles.ravel(), thirds, len(scan.vertices)), dtype=float)


def _carried(scan: Surface, carrier: Surface) -> sparse.csr_matrix:
    """The matrix (n, m) that takes a field from the vertices of a coarser copy to those of the scan."""
    if carrier is scan:
        return sparse.identity(len(scan.vertices), format="csr")
    _, triangles, places = Distance(carrier).closest(scan.vertices)
    return barycentric_matrix(places, carrier.triangles[triangles], carrier.vertices)


def _smooth(carrier: Surface) -> sparse.csr_matrix:
    """Energy (m, m) of a field's bending along a surface, and of its size."""
    mass = np.maximum(vertex_areas(carrier), 1e-9)
    laplacian = sparse.csr_matrix(igl.cotmatrix(carrier.vertices, carrier.triangles))
    bending = LENGTH**4 * laplacian.T @ sparse.diags(1 / mass) @ laplacian
    return (bending + TIED * sparse.diags(mass)).tocsr()


def _solved(
    normals: Array, weights: Array, right: Array, carried: sparse.csr_matrix, smooth: sparse.csr_matrix
) -> Array:
    """Field (m, 3) of least energy that moves the scan's vertices along the normals by `right` (n,)."""
    rows = sparse.hstack([sparse.diags(normals[:, i]) @ carried for i in range(3)], format="csr")
    matrix = rows.T @ sparse.diags(weights) @ rows + sparse.kron(sparse.identity(3), smooth)
    found = factorise(sparse.csr_matrix(matrix)).solve(rows.T @ (weights * right))
    return np.asarray(found).reshape(3, -1).T


def _within_volume(scan: Surface, field: Array, mass: Array, volume: float) -> Array:
    """The field, where needed with an offset along the normals that keeps the volume near `volume`."""
    normals = scan.vertex_normals()
    found = scan.volume() + float(mass @ np.einsum("ij,ij->i", normals, field))
    excess = found - np.clip(found, (1.0 - VOLUME) * volume, (1.0 + VOLUME) * volume)
    return field - excess / mass.sum() * normals
