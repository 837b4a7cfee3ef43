"""Smoothing of surfaces."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.mesh.surfaces.surface import Surface


def averaging(surface: Surface) -> sparse.csr_matrix:
    """Matrix (n, n) that gives each vertex the mean of its neighbours; a vertex without any keeps itself."""
    n = len(surface.vertices)
    i, j = surface.triangles.ravel(), np.roll(surface.triangles, -1, axis=1).ravel()
    adjacency = sparse.coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)).tocsr()
    adjacency = (adjacency + adjacency.T).tocsr()
    adjacency.data[:] = 1.0  # an inner edge is in two triangles
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return (sparse.diags(1 / np.maximum(degree, 1)) @ adjacency + sparse.diags((degree == 0) * 1.0)).tocsr()


def laplacian(surface: Surface, iterations: int, *, step: float = 0.5) -> Surface:
    """Laplacian smoothing; a closed surface keeps its volume, by an offset along normals after every step."""
    closed, volume = surface.is_closed(), surface.volume()
    mean = averaging(surface)
    for _ in range(iterations):
        surface = surface.moved(surface.vertices + step * (mean @ surface.vertices - surface.vertices))
        if closed:
            surface = _with_volume(surface, volume)
    return surface


def taubin(surface: Surface, iterations: int, *, passband: float = 0.1, step: float = 0.5) -> Surface:
    """Smoothing that shrinks little: a positive and a negative step in turn (Taubin 1995).

    `passband` is the frequency (of the normalised Laplacian, 0 to 2) that is left as it is.
    """
    closed, volume = surface.is_closed(), surface.volume()
    mean = averaging(surface)
    back = 1 / (passband - 1 / step)
    for _ in range(iterations):
        for factor in (step, back):
            surface = surface.moved(surface.vertices + factor * (mean @ surface.vertices - surface.vertices))
    return _with_volume(surface, volume) if closed else surface


def _with_volume(surface: Surface, volume: float) -> Surface:
    """Offset along the vertex normals that restores an enclosed volume, to first order."""
    offset = (volume - surface.volume()) / surface.area()
    return surface.moved(surface.vertices + offset * surface.vertex_normals())
