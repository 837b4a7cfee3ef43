"""Collision surfaces for the IPC Toolkit: areas, which pairs may collide, sets of collisions."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.contact import ipctk

NEIGHBOUR_RINGS = 3  # so many edges apart along a surface, vertices that are near at rest are neighbours


def new_collisions() -> ipctk.NormalCollisions:
    """An empty set, whose pairs will be weighted by area.

    A place that several pairs see is counted several times. The toolkit's correction for that
    (IMPROVED_MAX_APPROX) is not taken: near parallel edges its energy jumps, by which of several threads is
    first too, and no line search finds its minimum.
    """
    collisions = ipctk.NormalCollisions()
    collisions.use_area_weighting = True
    return collisions


def generic_hessian(
    potential: ipctk.BarrierPotential,
    collisions: ipctk.NormalCollisions,
    mesh: ipctk.CollisionMesh,
    positions: Array,
) -> sp.csc_matrix:
    """A Hessian in which no entry of a colliding pair is zero by chance or cancels against another's.

    Surfaces are shaken a little, and each pair's eigenvalues made positive.
    """
    shaken = positions + 1e-6 * potential.dhat * np.random.default_rng(0).normal(size=positions.shape)
    return potential.hessian(collisions, mesh, np.asfortranarray(shaken), ipctk.PSDProjectionMethod.ABS)


def collision_mesh(positions: Array, triangles: IntArray, count: int) -> ipctk.CollisionMesh:
    """Collision mesh of surface vertices and, from `count` on, obstacle vertices.

    A coarse obstacle's large triangles must not weigh more where they meet the surface's small ones.
    """
    faces = np.asfortranarray(triangles, dtype=np.int32)
    mesh = ipctk.CollisionMesh(positions, ipctk.edges(faces), faces)
    if count < len(positions):
        mesh.vertex_areas = _capped(mesh.vertex_areas, np.arange(len(positions)) < count)
        mesh.edge_areas = _capped(mesh.edge_areas, (mesh.edges < count).all(axis=1))
    return mesh


def _capped(areas: Array, own: BoolArray) -> Array:
    out = np.array(areas)
    out[~own] = np.minimum(out[~own], np.median(out[own]))
    return out


def collision_filter(count: int, fixed: int, self_contact: bool) -> ipctk.CollisionFilter:
    """Which pairs of vertices may collide: never two of the obstacle."""
    allowed = ipctk.make_static_obstacle_filter(count)
    if not self_contact:
        patches = np.repeat(np.arange(2, dtype=np.int32), (count, fixed))
        allowed = allowed & ipctk.make_vertex_patches_filter(patches)
    return allowed


class Neighbours:
    """Pairs of surface vertices of parts that are near at rest and few edges apart: they never collide.

    Parameters
    ----------
    pairs : integer array (k, 2)
        The pairs, each once, the smaller vertex first.
    """

    def __init__(self, pairs: IntArray) -> None:
        self.pairs = pairs
        self._keys = _keys(pairs[:, 0], pairs[:, 1])

    def filter(self) -> ipctk.CollisionFilter:
        """Which pairs of vertices may collide: all others."""
        return ipctk.make_sparse_filter({(int(i), int(j)): False for i, j in self.pairs}, True)

    def let_through(self, edges: IntArray, triangles: IntArray) -> BoolArray:
        """Which edges (c, 2) may have come through their triangles (c, 3), as mask (c,).

        An edge comes into a triangle through one of its sides or with one of its own ends. Where all vertices
        of the two are neighbours, nothing stops it, even if it collides with the triangle's other corner.
        """
        ends, corners = edges[:, :, None], triangles[:, None, :]
        keys = _keys(np.minimum(ends, corners), np.maximum(ends, corners))
        near: BoolArray = np.isin(keys, self._keys)
        by_end = np.any(np.all(near, axis=2), axis=1)
        by_side = np.any([np.delete(near, i, axis=2).all(axis=(1, 2)) for i in range(3)], axis=0)
        return np.asarray(by_end | by_side)


def _keys(lower: IntArray, upper: IntArray) -> IntArray:
    """One number for each pair of vertices."""
    return lower.astype(np.int64) << 32 | upper.astype(np.int64)


def neighbours(mesh: ipctk.CollisionMesh, count: int, distance: float) -> Neighbours:
    """Surface vertices of parts that are nearer than `distance` at rest and few edges apart."""
    rest, edges, faces = mesh.rest_positions, mesh.edges, mesh.faces
    candidates = ipctk.Candidates()
    candidates.build(mesh, rest, 0.5 * distance, ipctk.LBVH())
    members = [
        candidate.vertex_ids(edges, faces)
        for kind in (candidates.fv_candidates, candidates.ee_candidates)
        for candidate in kind
        if candidate.compute_distance(rest, edges, faces) < distance**2
    ]
    none = Neighbours(np.zeros((0, 2), dtype=np.int64))
    if not members:
        return none
    ids = np.array(members)
    pairs = np.concatenate([ids[:, [a, b]] for a in range(4) for b in range(a + 1, 4)])
    pairs = np.unique(np.sort(pairs[(pairs < count).all(axis=1)], axis=1), axis=0)
    if not len(pairs):  # only the obstacle is near
        return none
    link = sp.csr_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(rest), len(rest)))
    ring = link + link.T + sp.eye(len(rest))
    near = ring
    for _ in range(NEIGHBOUR_RINGS - 1):
        near = near @ ring
    close = np.asarray(near.tocsr()[pairs[:, 0], pairs[:, 1]]).ravel() > 0
    return Neighbours(pairs[close & (pairs[:, 0] != pairs[:, 1])])
