"""Exact tests of which closed surfaces intersect, and the depth of one inside another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.contact import crossings, ipctk
from handpipe.mesh.surfaces import Distance, Surface, concatenate


@dataclass(frozen=True, eq=False)
class Collider:
    """A closed surface that may collide with others.

    Triangles with an attached vertex are tied: they collide with no bone and no other tied triangle.

    Attributes
    ----------
    name : str
        Name of the body.
    surface : Surface
        The closed surface.
    attached : (k,)
        Attached vertices, which neither move nor collide.
    fixed : bool
        Whether the body is fixed, as a bone.
    visible : (n,) bool, optional
        Vertices whose places an image shows; None if this is unknown.
    """

    name: str
    surface: Surface
    attached: IntArray
    fixed: bool = False
    visible: BoolArray | None = None

    @cached_property
    def tied(self) -> BoolArray:
        """Which triangles (k,) have an attached vertex."""
        return np.asarray(np.isin(self.surface.triangles, self.attached).any(axis=1))

    @cached_property
    def copies(self) -> tuple[IntArray, IntArray]:
        """Vertex (m,) of every copy, triangles (k, 3) on copies: tied triangles have vertices of their own.

        The IPC Toolkit filters by vertex: separate copies let it tell tied triangles from others.
        """
        n, triangles = len(self.surface.vertices), self.surface.triangles.copy()
        own = np.unique(triangles[self.tied])
        number = np.full(n, -1)
        number[own] = n + np.arange(len(own))
        triangles[self.tied] = number[triangles[self.tied]]
        return np.concatenate([np.arange(n), own]), triangles

    @cached_property
    def free(self) -> IntArray:
        """Vertices that collide."""
        return np.setdiff1d(np.arange(len(self.surface.vertices)), self.attached)


def collision_filter(
    bodies: Sequence[Collider], chosen: IntArray | None = None, with_themselves: Sequence[int] = ()
) -> ipctk.CollisionFilter:
    """Filter of the copies that may collide, bodies in order.

    Excluded are two fixed copies, a tied copy with a tied or fixed one, and copies of one body, except untied
    ones of the bodies `with_themselves`. `chosen` (n,) limits the filter to some copies.
    """
    counts = [len(b.copies[0]) for b in bodies]
    body = np.repeat(np.arange(len(bodies)), counts)
    passive = np.concatenate(
        [
            np.full(c, True) if b.fixed else np.arange(c) >= len(b.surface.vertices)
            for b, c in zip(bodies, counts, strict=True)
        ]
    )
    group = np.where(passive, 0, 1 + np.arange(len(passive)))
    of = slice(None) if chosen is None else chosen
    apart = ipctk.make_vertex_patches_filter(body[of].astype(np.int32))
    others = apart & ipctk.make_vertex_patches_filter(group[of].astype(np.int32))
    if not len(with_themselves):
        return others
    alone = len(bodies) + np.arange(len(body))
    own = np.where(np.isin(body, with_themselves) & ~passive, body, alone)
    return others | ~ipctk.make_vertex_patches_filter(own[of].astype(np.int32))


def meet(a: Collider, b: Collider, at_a: Surface, at_b: Surface) -> bool:
    """Whether two bodies at their current surfaces intersect, or one contains the other.

    The test is exact: every edge against every triangle, and winding numbers.
    """
    xa, xb = at_a.vertices, at_b.vertices
    near_a, near_b = _in_box(xa, xb), _in_box(xb, xa)
    if not near_a.any() and not near_b.any() and not _boxes_cross(xa, xb):
        return False
    return _cut(a, b, xa, xb) or _inside(xa[a.free], at_b) or _inside(xb[_probes(b, xb, xa)], at_a)


def _boxes_cross(xa: Array, xb: Array) -> bool:
    return bool(((xa.min(axis=0) <= xb.max(axis=0)) & (xb.min(axis=0) <= xa.max(axis=0))).all())


def _in_box(points: Array, other: Array) -> BoolArray:
    return ((points >= other.min(axis=0)) & (points <= other.max(axis=0))).all(axis=1)


def _cut(a: Collider, b: Collider, xa: Array, xb: Array) -> bool:
    """Whether an edge of one body cuts a triangle of the other; only triangles in both boxes are tested."""
    (of_a, triangles_a), (of_b, triangles_b) = a.copies, b.copies
    xa, xb = xa[of_a], xb[of_b]
    low, high = np.maximum(xa.min(axis=0), xb.min(axis=0)), np.minimum(xa.max(axis=0), xb.max(axis=0))
    near_a, near_b = _reaching(xa, triangles_a, low, high), _reaching(xb, triangles_b, low, high)
    if not len(near_a) or not len(near_b):
        return False
    chosen, faces = np.unique(np.concatenate([near_a, near_b + len(xa)]), return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    at = np.asfortranarray(np.concatenate([xa, xb])[chosen])
    mesh = ipctk.CollisionMesh(at, ipctk.edges(faces), np.asfortranarray(faces))
    mesh.can_collide = collision_filter([a, b], chosen)
    return bool(ipctk.has_intersections(mesh, at, ipctk.LBVH()))


def crossing(a: Collider, b: Collider, xa: Array, xb: Array) -> IntArray:
    """Vertices (k,) of a whose edges or triangles, at xa (n, 3), cross those of b at xb (m, 3).

    As in `meet`, crossings of two tied triangles do not count.
    """
    (of_a, triangles_a), (of_b, triangles_b) = a.copies, b.copies
    both = concatenate([Surface(xa[of_a], triangles_a), Surface(xb[of_b], triangles_b)])
    number = np.concatenate([of_a, of_b])
    of_first = np.arange(len(number)) < len(of_a)
    tied = np.concatenate([np.arange(len(of)) >= len(x) for of, x in ((of_a, xa), (of_b, xb))])
    found = crossings(both)
    ends, corners = both.edges()[found[:, 0]], both.triangles[found[:, 1]]
    one, other = ends[:, 0], corners[:, 0]
    crosses = (of_first[one] != of_first[other]) & ~(tied[one] & tied[other])
    met = np.concatenate([ends[crosses].ravel(), corners[crosses].ravel()])
    return np.unique(number[met[of_first[met]]])


def folds(surface: Surface) -> IntArray:
    """Vertices (k,) of a surface's edges and triangles that cross one another; all, if it is inside out."""
    edges, triangles = crossings(surface).T
    if not len(edges) and surface.volume() < 0:
        return np.arange(len(surface.vertices))
    return np.unique(np.concatenate([surface.edges()[edges].ravel(), surface.triangles[triangles].ravel()]))


def _reaching(x: Array, triangles: IntArray, low: Array, high: Array) -> IntArray:
    """Triangles (k, 3) whose boxes meet the box from low to high."""
    corners = x[triangles]
    meets = (corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)
    return triangles[meets.all(axis=1)]


def _probes(b: Collider, xb: Array, xa: Array) -> IntArray:
    """Vertices of b that show whether b is inside a. Of a bone it is one: muscles attach inside it."""
    if not b.fixed:
        return b.free
    return np.array([np.argmax(np.linalg.norm(xb - xa.mean(axis=0), axis=1))])


def _inside(points: Array, surface: Surface) -> bool:
    near = points[_in_box(points, surface.vertices)]
    return len(near) > 0 and bool(surface.contains(near).any())


def depth(a: Collider, xa: Array, other: Distance) -> float:
    """Penetration in mm of a's free vertices, edge midpoints and triangle centres into a surface."""
    triangles, edges = a.surface.triangles[~a.tied], a.surface.edges()
    edges = edges[~np.isin(edges, a.attached).any(axis=1)]
    points = np.concatenate([xa[a.free], xa[edges].mean(axis=1), xa[triangles].mean(axis=1)])
    near = points[_in_box(points, other.surface.vertices)]
    return float(other.depths(near).max(initial=0.0))
