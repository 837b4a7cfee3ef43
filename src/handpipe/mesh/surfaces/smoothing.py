"""Smoothing of surfaces."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.mesh.surfaces.surface import Surface


def averaging(surface: Surface) -> sparse.csr_matrix:
    """The matrix that gives each vertex the mean of its neighbours.

    Parameters
    ----------
    surface : Surface
        Surface whose edges tell which vertices are neighbours.

    Returns
    -------
    sparse matrix (n, n)
        Its rows sum to 1. A vertex without neighbours keeps its own value.
    """
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
    """A smoothed surface that shrinks little: positive and negative steps alternate.

    A closed surface keeps its volume, by an offset along the vertex normals at the end.

    Parameters
    ----------
    surface : Surface
        Surface to smooth.
    iterations : int
        Number of pairs of steps.
    passband : float
        Frequency of the normalised Laplacian, from 0 to 2, above which details are damped.
    step : float
        Share of the way to the mean of its neighbours that a vertex moves in a positive step.

    Returns
    -------
    Surface
        The same triangles on other vertices.

    References
    ----------
    Taubin 1995.
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
