"""Which place of the image's skin each vertex of a scan belongs to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, IntArray, robust
from handpipe.mesh.surfaces import Distance, barycentric_matrix

AGREEING = 0.6  # cosine of the angle up to which two normals are those of one place


@dataclass(frozen=True)
class Matches:
    """The closest places on a surface to points, and what speaks for them.

    Parameters
    ----------
    signed : array (k,)
        Distances in mm of the points beyond the surface, negative inside.
    feet : array (k, 3)
        Closest places in mm.
    normals : array (k, 3)
        Unit normals there.
    corners : array (k, 3) of int
        Vertices of the triangles of the closest places.
    valid : array (k,) of bool
        Whether the place is skin whose normal agrees with the point's.
    """

    signed: Array
    feet: Array
    normals: Array
    corners: IntArray
    valid: BoolArray

    @staticmethod
    def find(points: Array, normals: Array, skin: Distance, trusted: BoolArray) -> Matches:
        """Matches of points (k, 3) with unit normals (k, 3) on a skin, of which some vertices are trusted."""
        distances, triangles, feet = skin.closest(points)
        corners = skin.surface.triangles[triangles]
        at = skin.surface.smooth_normals(barycentric_matrix(feet, corners, skin.surface.vertices))
        outside = np.einsum("ij,ij->i", points - feet, at) > 0
        signed = np.where(outside, distances, -distances)
        agree = np.einsum("ij,ij->i", at, normals) > AGREEING
        return Matches(signed, feet, at, corners, agree & trusted[corners].all(axis=1))

    def interpolation(self, vertices: Array) -> sparse.csr_matrix:
        """The matrix from the skin's vertices (n, 3) to the feet."""
        return barycentric_matrix(self.feet, self.corners, vertices)

    def weights(self, least: float) -> Array:
        """Tukey's biweights (k,), zero where a match is not valid; `least` mm are within the noise."""
        if not self.valid.any():
            return np.zeros(len(self.signed))
        deviation = max(robust.NORMAL * float(np.median(np.abs(self.signed[self.valid]))), least)
        weights = np.maximum(1 - (self.signed / (robust.TUKEY * deviation)) ** 2, 0.0) ** 2
        return np.where(self.valid, weights, 0.0)
