"""Points carried by a moving surface: fixed in a triangle's frame, at a height over it."""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces.barycentric import barycentric_weights, flat
from handpipe.mesh.surfaces.surface import Surface


@dataclass(frozen=True)
class Anchors:
    """Points at a fixed place in a triangle, at a fixed height along its normal.

    Parameters
    ----------
    corners : array (n, 3) of int
        Vertices of each point's triangle.
    weights : array (n, 3)
        Barycentric weights of the corners.
    heights : array (n,)
        Heights along the triangle's normal in mm.
    """

    corners: IntArray
    weights: Array
    heights: Array

    @staticmethod
    def attach(points: Array, surface: Surface) -> Anchors:
        """Anchor points (n, 3) at their closest places on a surface; never in a triangle without area."""
        # Its neighbours have the same places, and normals.
        whole = surface.triangles[~flat(surface.vertices[surface.triangles])]
        # Beyond an edge several triangles are equally close, and their normals carry a point to different
        # places: igl's choice of them stays what it was in earlier results.
        _, triangles, closest = igl.point_mesh_squared_distance(
            np.ascontiguousarray(points, dtype=np.float64), surface.vertices, whole
        )
        corners = whole[triangles]
        a, b, c = np.moveaxis(surface.vertices[corners], 1, 0)
        normal = np.cross(b - a, c - a)
        heights = np.einsum("ni,ni->n", points - closest, normal) / np.sqrt(
            np.einsum("ni,ni->n", normal, normal)
        )
        return Anchors(corners, barycentric_weights(closest, surface.vertices[corners]), heights)

    def feet(self, vertices: Array) -> Array:
        """Places (n, 3) on the moved surface."""
        return np.einsum("nc,nci->ni", self.weights, vertices[self.corners])

    def normals(self, vertices: Array) -> Array:
        """Unit normals (n, 3) of the anchors' triangles."""
        a, b, c = np.moveaxis(vertices[self.corners], 1, 0)
        normal = np.cross(b - a, c - a)
        return normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def __call__(self, vertices: Array) -> Array:
        """Points (n, 3) carried by the moved surface's vertices."""
        return self.feet(vertices) + self.heights[:, None] * self.normals(vertices)

    def arrays(self) -> dict[str, NDArray]:
        """For an artifact."""
        return {"corners": self.corners, "weights": self.weights, "heights": self.heights}
