"""Bodies deflated towards their medial surfaces until none is inside another.

From this initial guess they can grow back without intersecting.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from handpipe.core import Array, IntArray
from handpipe.mesh.surfaces import Surface
from handpipe.mesh.tets import cotangent_laplacian, mass_lumped

STEP_SHARE = 0.15  # share of the way to the medial surface, in one step
LARGEST_SHARE = 0.95  # share of the way, in all steps
LENGTH_GROWTH = 1.5  # growth of the smoothing length in one further step
LONGEST_SHARE = 0.5  # largest smoothing length as a share of the body's size
BALL_ROUNDS = 30  # rounds in which an inscribed ball may shrink


class Deflation:
    """A closed surface that is deflated step by step where it intersects others.

    A body first shrinks towards its medial surface. That does not suffice where medial surfaces cross, or
    where a tip reaches into the other body. There smoothing over growing lengths retracts tips and turns
    bodies into threads, which rarely cross.
    """

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self._mass = mass_lumped(surface.vertices, surface.triangles)
        self._laplacian = cotangent_laplacian(surface.vertices, surface.triangles)
        radii = inscribed_radii(surface)
        # Corners of the mesh make the balls of neighbouring vertices differ.
        edge = float(np.median(surface.edge_lengths()))
        self._inwards = self._diffused(-radii[:, None] * surface.vertex_normals(), edge)
        self._around = max(float(np.median(radii)), edge)
        self._longest = LONGEST_SHARE * float(np.ptp(surface.vertices, axis=0).max())
        self._shares, self._weights = np.zeros(len(radii)), np.zeros(len(radii))
        self._length = 0.0

    def thin(self, meeting: IntArray) -> bool:
        """Whether the body has reached its medial surface at the vertices (k,)."""
        return bool(self._shares[meeting].min() >= LARGEST_SHARE)

    def step(self, meeting: IntArray) -> None:
        """Deflate around the vertices (k,) that intersect another body."""
        if not self.thin(meeting):
            self._shares = np.minimum(
                self._shares + STEP_SHARE * self._spread(meeting, self._around), LARGEST_SHARE
            )
        else:
            self._length = min(max(LENGTH_GROWTH * self._length, self._around), self._longest)
            self._weights = np.maximum(self._weights, self._spread(meeting, self._length))

    def vertices(self) -> Array:
        """Vertices (n, 3) after the steps taken."""
        x = self._surface.vertices + self._shares[:, None] * self._inwards
        if self._length == 0.0:
            return x
        return x + self._weights[:, None] * (self._diffused(x, self._length) - x)

    def pushed(self, vertices: IntArray, directions: Array) -> Array:
        """Displacements (n, 3) that move vertices (k,) by about `directions` (k, 3), in mm, and fade."""
        fields = np.zeros((len(self._mass), 4))
        fields[vertices] = np.column_stack([np.ones(len(vertices)), directions])
        there, given = np.split(self._diffused(fields, self._around), [1], axis=1)
        return _fading(there, vertices) * given / np.maximum(there, 1e-12)

    def _spread(self, vertices: IntArray, length: float) -> Array:
        """Field (n,) that is one at the vertices (k,) and fades from them over a length in mm."""
        field = np.zeros((len(self._mass), 1))
        field[vertices] = 1.0
        return _fading(self._diffused(field, length)[:, 0], vertices)

    def _diffused(self, x: Array, length: float) -> Array:
        """Fields (n, c) smoothed over a length in mm: one implicit step of the heat equation at rest."""
        matrix = sparse.diags(self._mass) + length**2 * self._laplacian
        return np.asarray(splu(matrix.tocsc()).solve(self._mass[:, None] * x))


def _fading(field: Array, vertices: IntArray) -> Array:
    """A diffused field scaled to be one at the vertices (k,)."""
    return np.clip(field / field[vertices].min(), 0.0, 1.0)


def inscribed_radii(surface: Surface) -> Array:
    """Radii (n,) in mm of the balls that touch the surface at its vertices from inside.

    Each ball shrinks until no vertex is in it (Ma et al. 2012, 3D medial axis point approximation using
    nearest neighbors).
    """
    points, normals = surface.vertices, surface.vertex_normals()
    tree = cKDTree(points)
    radii = np.full(len(points), 0.5 * float(np.ptp(points, axis=0).max()))
    active = np.arange(len(points))
    for _ in range(BALL_ROUNDS):
        centres = points[active] - radii[active, None] * normals[active]
        distances, nearest = tree.query(centres)
        inside = (distances < radii[active] * (1 - 1e-6)) & (nearest != active)
        active, nearest = active[inside], nearest[inside]
        if len(active) == 0:
            break
        across = points[active] - points[nearest]
        depth = np.einsum("ki,ki->k", across, normals[active])
        radii[active] = np.einsum("ki,ki->k", across, across) / np.maximum(2 * depth, 1e-12)
    return radii
