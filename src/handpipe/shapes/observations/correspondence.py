"""Markers on a body's boundary, and the points of its surface that correspond to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Distance, Surface, barycentric_matrix


@dataclass(frozen=True)
class Markers:
    """Places on the boundary of a body, with weights.

    Parameters
    ----------
    points : array (r, 3)
        Places in mm.
    weights : array (r,)
        Weights of their squared distances from the surface, zero or more.
    vertices : integer array (r,), optional
        Surface vertices from which the markers were found and which correspond to them; by default the
        closest point of the surface corresponds to each.

    References
    ----------
    Wang 2021 Eq. 5.5.
    """

    points: Array
    weights: Array
    vertices: IntArray | None = None


@dataclass(frozen=True)
class Correspondence:
    """Points of a body and the targets that correspond to them.

    Parameters
    ----------
    matrix : sparse matrix (r, n)
        Weights of the body's vertices for each point.
    targets : array (r, 3)
        Targets in mm.
    metrics : array (r, 3, 3), optional
        Roots of the quadratic forms that measure each error; None: plain distances.
    """

    matrix: sparse.csr_matrix
    targets: Array
    metrics: Array | None

    @staticmethod
    def none(vertices: int) -> Correspondence:
        """No points of a body with that many vertices."""
        return Correspondence(sparse.csr_matrix((0, vertices)), np.zeros((0, 3)), None)

    @staticmethod
    def match(
        markers: Markers, surface: Surface, embedding: sparse.csr_matrix, tangential: float
    ) -> Correspondence:
        """Points of the current surface, which embedding (v, n) carries, that correspond to markers.

        Errors count in full along the surface's normal and by the share `tangential` along the surface: a
        marker says where the boundary is, not which of its points is there.
        """
        if markers.vertices is None:
            _, triangles, closest = Distance(surface).closest(markers.points)
            feet = barycentric_matrix(closest, surface.triangles[triangles], surface.vertices)
            matrix = feet @ embedding
            normals = surface.triangle_normals()[triangles]
        else:
            matrix = embedding[markers.vertices]
            normals = surface.vertex_normals()[markers.vertices]
        across = normals[:, :, None] * normals[:, None]
        root = across + np.sqrt(tangential) * (np.eye(3) - across)
        return Correspondence(matrix, markers.points, np.sqrt(markers.weights)[:, None, None] * root)

    def joined(self, other: Correspondence) -> Correspondence:
        """These points and others of the same body."""
        return Correspondence(
            sparse.vstack([self.matrix, other.matrix], format="csr"),
            np.concatenate([self.targets, other.targets]),
            np.concatenate([self._metrics(), other._metrics()]),
        )

    def carried(self, carry: sparse.csr_matrix) -> Correspondence:
        """The same points by the vertices of a body that `carry` (n, n1) takes to those of this one."""
        return Correspondence((self.matrix @ carry).tocsr(), self.targets, self.metrics)

    def _metrics(self) -> Array:
        return np.tile(np.eye(3), (self.count, 1, 1)) if self.metrics is None else self.metrics

    @property
    def count(self) -> int:
        """Number r of points."""
        return len(self.targets)

    def errors(self, x: Array) -> Array:
        """Offsets (r, 3) in mm of vertices (n, 3) from the targets."""
        return self.matrix @ x - self.targets

    def distances(self, x: Array) -> Array:
        """Distances (r,) in mm by the metrics: mainly along the normals for markers."""
        errors = self.errors(x)
        if self.metrics is None:
            return np.linalg.norm(errors, axis=1)
        weights = np.sqrt(np.einsum("rij,rij->r", self.metrics, self.metrics))
        measured = np.linalg.norm(np.einsum("rij,rj->ri", self.metrics, errors), axis=1)
        return np.divide(measured, weights, out=np.zeros_like(measured), where=weights > 0)

    def rows(self, x: Array) -> tuple[sparse.csr_matrix, Array]:
        """Weighted residuals (3 r,) at x and their derivative (3 r, 3 n)."""
        derivative = sparse.kron(self.matrix, sparse.eye(3), format="csr")
        residuals = self.errors(x)
        if self.metrics is None or self.count == 0:
            return derivative, residuals.ravel()
        blocks = sparse.bsr_matrix((self.metrics, np.arange(self.count), np.arange(self.count + 1)))
        return (blocks @ derivative).tocsr(), blocks @ residuals.ravel()

    def energy(self, x: Array) -> float:
        """Sum of the squared weighted residuals."""
        errors = self.errors(x)
        if self.metrics is not None:
            errors = np.einsum("rij,rj->ri", self.metrics, errors)
        return float((errors**2).sum())


def fixed_markers(points: Array) -> Callable[[Surface], Markers]:
    """Function that returns markers placed by hand, the same for every surface.

    Parameters
    ----------
    points : array (r, 3)
        Places on the boundary in mm.

    Returns
    -------
    callable
        From a surface to the markers, each of weight one and without a vertex.
    """
    markers = Markers(points, np.ones(len(points)))
    return lambda surface: markers
