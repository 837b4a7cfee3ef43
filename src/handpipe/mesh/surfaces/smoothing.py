"""Smoothing of surfaces."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray
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


def delta_mush(rest: Surface, vertices: Array, iterations: int, *, step: float = 0.5) -> Array:
    """A deformed surface without what is rough in its deformation; what is rough at rest stays.

    Both surfaces are smoothed. What smoothing takes from the surface at rest is given back to the deformed
    one, in each vertex' own frame.

    Parameters
    ----------
    rest : Surface
        Surface at rest.
    vertices : array (n, 3)
        Its vertices as deformed.
    iterations : int
        Number of times that both are smoothed.
    step : float
        Share of the way to the mean of its neighbours that a vertex moves each time.

    Returns
    -------
    array (n, 3)
        The smoothed deformation.

    References
    ----------
    Mancewicz 2014; Wang 2019 §5.4.
    """
    mean = averaging(rest)
    before, after = rest.vertices, vertices
    for _ in range(iterations):
        before, after = before + step * (mean @ before - before), after + step * (mean @ after - after)
    neighbour = np.asarray(mean.argmax(axis=1)).ravel()
    details = np.einsum("nji,nj->ni", _frames(rest.moved(before), neighbour), rest.vertices - before)
    return np.asarray(after + np.einsum("nij,nj->ni", _frames(rest.moved(after), neighbour), details))


def _frames(surface: Surface, neighbour: IntArray) -> Array:
    """Orthonormal columns (n, 3, 3) at each vertex: its normal, and directions along the surface.

    The second one is that to a neighbour (n,).
    """
    normal = surface.vertex_normals()
    along = surface.vertices[neighbour] - surface.vertices
    along -= np.einsum("ni,ni->n", along, normal)[:, None] * normal
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    return np.stack([normal, along, np.cross(normal, along)], axis=2)


def _with_volume(surface: Surface, volume: float) -> Surface:
    """Offset along the vertex normals that restores an enclosed volume, to first order."""
    offset = (volume - surface.volume()) / surface.area()
    return surface.moved(surface.vertices + offset * surface.vertex_normals())
