"""How spiky a deformed surface is at its marks.

A method whose energy has as many derivatives as a point constraint needs gives smooth shapes, and a finer
mesh shows the same shape; with fewer, the shape comes to a point at each mark, the more so the finer the
mesh (Wang 2021 §5.8). For a smooth surface on a lattice of triangles both measures converge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import cotangent_laplacian, mass_lumped


@dataclass(frozen=True)
class Neighbourhood:
    """The vertices (k,) of a surface at rest that are near its marks."""

    surface: Surface
    vertices: IntArray

    @staticmethod
    def around(surface: Surface, marks: IntArray, side: IntArray, reach: float) -> Neighbourhood:
        """Those among `side` within reach (mm, at rest) of a mark: the same region on any mesh."""
        x = surface.vertices
        distances, _ = cKDTree(x[marks]).query(x[side])
        return Neighbourhood(surface, side[distances <= reach])

    def spikiness(self, x: Array) -> float:
        """Largest over mean change of the mean curvature, from rest to vertices x (n, 3)."""
        change = np.abs(mean_curvature(self.surface.moved(x)) - mean_curvature(self.surface))[self.vertices]
        areas = mass_lumped(self.surface.vertices, self.surface.triangles)[self.vertices]
        return float(change.max() * areas.sum() / (areas @ change))

    def normal_errors(self, x: Array, truth: Array) -> Array:
        """Angles (k,) in degrees between normals at x (n, 3) and those of the true shape (n, 3)."""
        found = self.surface.moved(x).vertex_normals()[self.vertices]
        wanted = self.surface.moved(truth).vertex_normals()[self.vertices]
        return np.degrees(np.arccos(np.clip((found * wanted).sum(axis=1), -1.0, 1.0)))


def mean_curvature(surface: Surface) -> Array:
    """Mean curvature (n,) in 1/mm, positive where convex; zero for vertices of no triangle."""
    x, triangles = surface.vertices, surface.triangles
    vectors = cotangent_laplacian(x, triangles) @ x
    areas = mass_lumped(x, triangles)
    return np.divide(
        0.5 * (vectors * surface.vertex_normals()).sum(axis=1), areas, out=np.zeros(len(x)), where=areas > 0
    )
