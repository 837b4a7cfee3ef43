"""The tendon's surface: a tube that its rod's segments carry (Zheng et al. 2022, sec. 5.3, Eq. 18)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.tendons.rods.rod import bishop_normals, closest_on_rod, perpendicular, tangents

SEGMENTS = 3  # segments that carry a surface vertex, neighbours on the rod


@dataclass(frozen=True)
class Tube:
    """A surface skinned by its rod.

    triangles (k, 3); each of the n vertices is carried by segments first .. first + 2, first (n,), with
    weights (n, 3), from its coordinates local (n, 3, 3) in their frames about their midpoints.
    """

    triangles: IntArray
    first: IntArray
    weights: Array
    local: Array

    @staticmethod
    def bind(surface: Surface, rest: Array, frames: Array) -> Tube:
        """Bind a surface to a rod rest (Q+1, 3) with frames (Q, 3, 3), Q >= 3, by inverse distances."""
        nearest, _, _ = closest_on_rod(surface.vertices, rest)
        first = np.clip(nearest - 1, 0, len(rest) - 1 - SEGMENTS)
        carriers = first[:, None] + np.arange(SEGMENTS)
        a, e = rest[carriers], rest[carriers + 1] - rest[carriers]
        offset = surface.vertices[:, None] - a
        t = np.clip(np.sum(offset * e, axis=2) / np.sum(e * e, axis=2), 0.0, 1.0)
        distance = np.linalg.norm(offset - t[..., None] * e, axis=2)
        weights = 1.0 / np.maximum(distance, 1e-6)
        weights /= weights.sum(axis=1, keepdims=True)
        local = np.einsum("nsji,nsj->nsi", frames[carriers], offset - 0.5 * e)
        return Tube(surface.triangles, first, weights, local)

    @property
    def carriers(self) -> IntArray:
        """Segments (n, 3) that carry each vertex."""
        return self.first[:, None] + np.arange(SEGMENTS)

    def skin(self, x: Array, frames: Array) -> Array:
        """Vertices (n, 3) for a rod x (Q+1, 3) with frames (Q, 3, 3); at rest, the rest surface."""
        middle = 0.5 * (x[1:] + x[:-1])
        carried = middle[self.carriers] + np.einsum("nsij,nsj->nsi", frames[self.carriers], self.local)
        return np.einsum("ns,nsj->nj", self.weights, carried)


def round_surface(x: Array, radii: Array | float, sides: int = 12) -> Surface:
    """Closed surface of rings about the vertices of a rod, with flat ends.

    Parameters
    ----------
    x : array (Q+1, 3)
        Rod in mm.
    radii : float or array (Q+1,)
        Radii in mm.
    sides : int
        Number of vertices of each ring.

    Returns
    -------
    Surface
        Surface in mm.
    """
    n, tangent = len(x), tangents(x)
    normal = bishop_normals(np.vstack([x, x[-1] + tangent[-1]]), perpendicular(tangent[0]))
    normal -= np.sum(normal * tangent, axis=1)[:, None] * tangent
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    angle = 2.0 * np.pi * np.arange(sides) / sides
    around = np.cos(angle)[None, :, None] * normal[:, None]
    around = around + np.sin(angle)[None, :, None] * np.cross(tangent, normal)[:, None]
    rings = x[:, None] + np.broadcast_to(np.asarray(radii, float), (n,))[:, None, None] * around
    vertices = np.vstack([rings.reshape(-1, 3), x[:1], x[-1:]])
    return Surface(vertices, _tube_triangles(n, sides))


def _tube_triangles(n: int, sides: int) -> IntArray:
    """Triangles of n rings in order, then the middles of the first and the last ring; they face outwards."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 1), np.arange(sides), indexing="ij"))
    a, b = i * sides + j, i * sides + (j + 1) % sides
    wall = np.vstack([np.stack([a, b, b + sides], axis=1), np.stack([a, b + sides, a + sides], axis=1)])
    j = np.arange(sides)
    following, last = (j + 1) % sides, (n - 1) * sides
    start = np.stack([np.full(sides, n * sides), following, j], axis=1)
    end = np.stack([np.full(sides, n * sides + 1), last + j, last + following], axis=1)
    return np.vstack([wall, start, end])
