"""A fine scan of the skin that a simulated skin carries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.fem.elements import polar
from handpipe.mesh.surfaces import Distance, Surface, barycentric_weights

FARTHEST = 3.0  # mm from the skin at rest: a scan farther off is not of this skin


@dataclass(frozen=True)
class CarriedScan:
    """Points beside a skin at rest, which follow it.

    A point keeps its distance from its closest place on the skin, and turns with the skin around it. On the
    skin itself it moves as the skin does. Turns are blended between vertices, so that nothing tears.

    Parameters
    ----------
    rest : Surface
        The skin at rest, in mm.
    corners : array (n, 3) of int
        Vertices of the triangle on which each point's closest place lies.
    weights : array (n, 3)
        Barycentric weights of that place.
    offsets : array (n, 3)
        From that place to the point at rest, in mm.

    References
    ----------
    Wang 2019 §5.6.
    """

    rest: Surface
    corners: IntArray
    weights: Array
    offsets: Array

    @staticmethod
    def attach(points: Array, rest: Surface) -> CarriedScan:
        """Attach points (n, 3) to a skin at rest, both in mm."""
        _, triangles, closest = Distance(rest).closest(points)
        corners = rest.triangles[triangles]
        weights = barycentric_weights(closest, rest.vertices[corners])
        return CarriedScan(rest, corners, weights, points - closest)

    @property
    def beside(self) -> BoolArray:
        """Mask (n,) of the points that are of this skin."""
        near: BoolArray = np.linalg.norm(self.offsets, axis=1) <= FARTHEST
        return near

    def __call__(self, vertices: Array) -> Array:
        """The points (n, 3) in mm with the skin's vertices (k, 3) in a pose."""
        places = np.einsum("nc,nci->ni", self.weights, vertices[self.corners])
        turns = vertex_turns(self.rest, vertices)[self.corners]
        blended = polar(np.ascontiguousarray(np.einsum("nc,ncij->nij", self.weights, turns)))[0]
        carried: Array = places + np.einsum("nij,nj->ni", blended, self.offsets)
        return carried


def vertex_turns(rest: Surface, vertices: Array) -> Array:
    """By how much a surface has turned around each vertex.

    Parameters
    ----------
    rest : Surface
        The surface at rest, in mm.
    vertices : array (n, 3)
        Its vertices in a pose.

    Returns
    -------
    array (n, 3, 3)
        Rotations: polar factors of the triangles' gradients, summed by area at rest.
    """
    before, after = (_frames(x[rest.triangles]) for x in (rest.vertices, vertices))
    # A triangle without area at rest has a generalised inverse, and no weight.
    gradients = np.ascontiguousarray(after @ np.linalg.pinv(before))
    turns = polar(gradients)[0] * rest.triangle_areas()[:, None, None]
    summed = np.zeros((len(vertices), 3, 3))
    for corner in rest.triangles.T:
        np.add.at(summed, corner, turns)
    return polar(summed)[0]


def _frames(corners: Array) -> Array:
    """Two edges and the unit normal of triangles (m, 3, 3), as columns (m, 3, 3)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    return np.stack([b - a, c - a, normal], axis=2)
