"""Marks of an organ's boundary: nearest points of the current surface correspond to them, or none."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from handpipe.core import Array, InputError, robust
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import Embedding, TetMesh, mass_lumped
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.correspondence import Correspondence, Markers

NEIGHBOURS = 3  # of a mark; where marks cover the boundary, none of it is farther from the nearest one


@dataclass(frozen=True)
class Pairs:
    """Points (k, 3) of the template at rest, and where they belong: targets (k, 3), in mm."""

    points: Array
    targets: Array

    def checked(self, source: str) -> Pairs:
        """The same; raises `InputError` where they are no pairs of finite points."""
        points, targets = (np.asarray(a, dtype=float) for a in (self.points, self.targets))
        if points.ndim != 2 or points.shape[1] != 3 or points.shape != targets.shape:
            problem = f"have the shapes {points.shape} and {targets.shape}"
            raise InputError(source, "points, targets", problem, "Give as many targets as points, (k, 3)")
        if not (np.isfinite(points).all() and np.isfinite(targets).all()):
            raise InputError(source, "points, targets", "NaN or infinite coordinates", "Place them all")
        return Pairs(points, targets)

    def attached(self, mesh: TetMesh) -> Attached:
        """The points as carried by the mesh's vertices."""
        matrix = Embedding.embed(self.points, mesh).matrix(len(mesh.vertices))
        return Attached(matrix, self.targets)


class BoundaryMarks:
    """Marks (r, 3) of weights (r,) that lie on the boundary of the body; which point of it is not known."""

    def __init__(
        self,
        mesh: TetMesh,
        points: Array,
        tangential: float,
        robust: float | None = None,
        covering: bool = False,
    ) -> None:
        """Marks (r, 3) on the boundary of a mesh.

        `robust` is the distance in mm below which none is unusual; None: all marks have equal weight.
        `covering`: the marks are all over the boundary, and no part of the body is far from all of them.
        """
        self.surface = mesh.boundary()
        self.points, self.tangential, self.robust = points, tangential, robust
        self._embedding = sparse.identity(len(mesh.vertices), format="csr")
        self._outer = mesh.boundary_vertices()
        self.covering = covering

    def thinned(self, most: int) -> BoundaryMarks:
        """At most that many of them, evenly from first to last."""
        found = copy.copy(self)
        found.points = self.points[:: max(-(-len(self.points) // most), 1)]
        return found

    def distances(self, x: Array) -> Array:
        """Distance (r,) of each mark from the surface at vertices (n, 3)."""
        return Distance(self.surface.moved(x)).closest(self.points)[0]

    def weights(self, x: Array) -> Array:
        """Tukey's biweight (r,) of the distances over their own scale: zero for marks far beyond it."""
        if self.robust is None or len(self.points) == 0:
            return np.ones(len(self.points))
        distances = self.distances(x)
        scale = max(robust.NORMAL * float(np.median(distances)), self.robust)
        return np.maximum(1 - (distances / (robust.TUKEY * scale)) ** 2, 0.0) ** 2

    def __call__(self, x: Array) -> Correspondence:
        """The marks of positive weight, and the closest points of the current surface."""
        if len(self.points) == 0:
            return Correspondence.none(len(x))
        weights = self.weights(x)
        keep = weights > 0
        present: Surface = self.surface.moved(x)
        markers = Markers(self.points[keep], weights[keep])
        found = Correspondence.match(markers, present, self._embedding, self.tangential)
        if not self.covering or keep.sum() <= NEIGHBOURS:
            return found
        return found.joined(self._astray(present, self.points[keep]))

    def _astray(self, present: Surface, points: Array) -> Correspondence:
        """Boundary vertices far from all marks, with targets at the nearest mark's reach.

        Each has the weight of its area, in squares of the marks' spacing.
        """
        tree = cKDTree(points)
        reach = tree.query(points, k=NEIGHBOURS + 1)[0][:, -1]
        x = present.vertices[self._outer]
        distances, nearest = tree.query(x)
        far = np.flatnonzero(distances > reach[nearest])
        mark, own = points[nearest[far]], reach[nearest[far]]
        areas = mass_lumped(present.vertices, present.triangles)[self._outer[far]]
        roots = np.sqrt(np.minimum(areas / own**2, 1.0))
        return Correspondence(
            self._embedding[self._outer[far]],
            mark + (own / distances[far])[:, None] * (x[far] - mark),
            roots[:, None, None] * np.eye(3),
        )


def with_landmarks(
    find: Callable[[Array], Correspondence], landmarks: Attached | None
) -> Callable[[Array], Correspondence]:
    """The same marks and landmarks with them."""
    if landmarks is None:
        return find
    return lambda x: find(x).joined(Correspondence(landmarks.matrix, landmarks.targets, None))
