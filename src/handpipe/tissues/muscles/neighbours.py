"""Which places of neighbouring surfaces lie against one another, and which stay so in every known pose."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from handpipe.core import Array, IntArray
from handpipe.mesh.contact import distance_to
from handpipe.mesh.surfaces import Distance, Surface, WaysBack, about, barycentric_matrix

Neighbours = dict[tuple[str, str], tuple[IntArray, Array]]

FADING = 0.25  # of the distance within which neighbours slide, over which sliding fades


@dataclass(frozen=True)
class SurfacePairs:
    """Pairs of vertices of one surface and places on another.

    Attributes
    ----------
    vertices : (c,)
        Vertices of one surface.
    feet : (c, v)
        Weights of the other surface's vertices closest to each.
    normals : (c, 3)
        Unit normals there, outwards.
    gaps : (c,)
        Gaps in mm, negative inside.
    rest : (c,)
        Gaps that sliding keeps, zero where unknown.
    """

    vertices: IntArray
    feet: sparse.csr_matrix
    normals: Array
    gaps: Array
    rest: Array

    def only(self, known: tuple[IntArray, Array] | None) -> SurfacePairs:
        """The pairs of given vertices, with their gaps."""
        if known is None:
            return self._at(np.arange(0), np.zeros(0))
        _, here, there = np.intersect1d(self.vertices, known[0], return_indices=True)
        return self._at(here, known[1][there])

    def without(self, attached: IntArray) -> SurfacePairs:
        """The pairs of all but given vertices."""
        chosen = np.flatnonzero(~np.isin(self.vertices, attached))
        return self._at(chosen, self.rest[chosen])

    def within(self, distance: float) -> SurfacePairs:
        """The pairs nearer than a distance in mm."""
        chosen = np.flatnonzero(self.gaps < distance)
        return self._at(chosen, self.rest[chosen])

    def sliding_share(self, near: float) -> Array:
        """Share (c,) of the full stiffness of each pair's sliding spring: it fades out towards `near` mm.

        A spring that switched on and off at full stiffness would make a muscle oscillate.
        """
        return np.clip((near - self.gaps) / (FADING * near), 0.0, 1.0)

    def _at(self, chosen: IntArray, rest: Array) -> SurfacePairs:
        return SurfacePairs(
            self.vertices[chosen], self.feet[chosen], self.normals[chosen], self.gaps[chosen], rest
        )


def pairs(a: Surface, b: Distance, near: float) -> SurfacePairs:
    """Vertices of a closer than `near` mm to a surface b or inside of it.

    Inside a thin body the closest place may be on the far side, which a's surface does not face: it would
    pull the vertex through. Such a vertex has the place where the way back, against a's normal, leaves the
    body, and is left free if none does within 4 mm; between both, a mean of both places: pairs that come and
    go as a muscle slides move it to and fro without end. Normals are smooth: with those of facets, a slender
    muscle that slides from one facet to the next oscillates, too.
    """
    ids, other = about(a.vertices, b.surface, near), b.surface
    if len(ids) == 0:
        nothing = sparse.csr_matrix((0, len(other.vertices)))
        return SurfacePairs(ids, nothing, np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    gap, triangles, closest, _ = b.signed(a.vertices[ids])
    close = np.flatnonzero(gap < near)
    ids, gap = ids[close], gap[close]
    feet = barycentric_matrix(closest[close], other.triangles[triangles[close]], other.vertices)
    points, sides, normals = a.vertices[ids], -a.vertex_normals()[ids], other.smooth_normals(feet)
    back = WaysBack.of(b, points, gap, normals, sides)
    led = back.triangles >= 0
    lost, share, ends = back.points[led], back.share[led], back.triangles[led]
    shares = np.ones(len(ids))
    shares[lost] = share
    ways = barycentric_matrix(back.places[led], other.triangles[ends], other.vertices)
    to_lost = sparse.csr_matrix((1 - share, (lost, np.arange(len(lost)))), shape=(len(ids), len(lost)))
    feet = (sparse.diags(shares) @ feet + to_lost @ ways).tocsr()
    normals[lost] = back.normals[led]
    gap[lost] = np.einsum("ni,ni->n", points[lost] - feet[lost] @ other.vertices, normals[lost])
    chosen = np.setdiff1d(np.arange(len(ids)), back.points[~led & (back.share == 0)])
    return SurfacePairs(ids[chosen], feet[chosen], normals[chosen], gap[chosen], np.zeros(len(chosen)))


def touching(surface: Surface, others: Iterable[Surface], near: float) -> IntArray:
    """Vertices within `near` mm of any of the other surfaces, or inside one."""
    found = np.zeros(len(surface.vertices), dtype=bool)
    for other in others:
        near_it = about(surface.vertices, other, near)
        found[near_it] |= distance_to(other).signed(surface.vertices[near_it])[0] < near
    return np.flatnonzero(found)


def sliding_vertices(poses: Sequence[Mapping[str, Surface]], near: float) -> Neighbours:
    """Proximity vertices and their mean gaps (Zheng 2022 §4.1).

    They are within `near` mm of the neighbour in every pose.
    """
    found: Neighbours = {}
    distances = [{name: distance_to(surface) for name, surface in pose.items()} for pose in poses]
    for a in poses[0]:
        for b in poses[0]:
            if a == b:
                continue
            ids = about(poses[0][a].vertices, poses[0][b], near)
            gaps = [d[b].signed(pose[a].vertices[ids])[0] for pose, d in zip(poses, distances, strict=True)]
            always = (np.array(gaps) < near).all(axis=0)
            if always.any():
                found[a, b] = ids[always], np.maximum(np.mean(gaps, axis=0)[always], 0.0)
    return found
