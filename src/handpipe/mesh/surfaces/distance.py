"""Distances from points to a surface, signed by angle-weighted pseudonormals (Baerentzen and Aanaes 2005)."""

from __future__ import annotations

import numpy as np
from numba import njit

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.surfaces.barycentric import barycentric_matrix, flat
from handpipe.mesh.surfaces.surface import Surface, sums_at
from handpipe.mesh.surfaces.triangle_tree import boxes_of, closest_places, ways_out

ON_EDGE = 1e-8  # barycentric coordinates below this lie on an edge or vertex
FACE, EDGE, VERTEX = 0, 1, 2  # where in a triangle a place lies


class Distance:
    """Distances to one surface, by a tree that is built once.

    Parameters
    ----------
    surface : Surface
        Surface to which distances are measured.
    by_winding : bool
        Whether the winding number decides the sign of a distance, not the side of the closest triangle. For a
        surface that cuts itself, that side changes far from the surface and the distance jumps there; by the
        winding number the distance is continuous.
    """

    def __init__(self, surface: Surface, *, by_winding: bool = False) -> None:
        self.surface, self.by_winding = surface, by_winding
        order, nodes = surface.tree()
        self._tree = order, nodes, boxes_of(surface.vertices, surface.triangles, order, nodes)
        # Their neighbours have the same places, and a normal.
        lines = flat(surface.vertices[surface.triangles])
        self._lines = lines & ~lines.all()
        self._normals: tuple[Array, Array, Array] | None = None

    def closest(self, points: Array) -> tuple[Array, IntArray, Array]:
        """The closest places on the surface.

        Parameters
        ----------
        points : array (n, 3)
            Points in mm.

        Returns
        -------
        distances : array (n,)
            Unsigned distances in mm.
        triangles : array (n,) of int
            Triangles in which the closest places are.
        closest : array (n, 3)
            Closest places in mm.
        """
        queries = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        if len(queries) == 0:
            return np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        surface = self.surface
        return closest_places(queries, surface.vertices, surface.triangles, self._tree, self._lines)

    def signed(self, points: Array) -> tuple[Array, IntArray, Array, Array]:
        """Signed distances and the closest places with their pseudonormals.

        The sign is exact for a closed surface that does not cut itself. Near the rim of an open surface it is
        that of the nearest triangle.

        Parameters
        ----------
        points : array (n, 3)
            Points in mm.

        Returns
        -------
        distances : array (n,)
            Distances in mm, negative inside.
        triangles : array (n,) of int
            Triangles in which the closest places are.
        closest : array (n, 3)
            Closest places in mm.
        normals : array (n, 3)
            Unit pseudonormals there. With `by_winding` they, too, point away from the inside.
        """
        distances, triangles, closest = self.closest(points)
        if self._normals is None:
            self._normals = _pseudonormals(self.surface)
        normals = _normals_at(
            closest, triangles, self.surface.vertices, self.surface.triangles, self._normals
        )
        queries = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        inside = np.einsum("ij,ij->i", queries - closest, normals) < 0
        if self.by_winding:
            wound = self.surface.contains(queries)
            normals[wound != inside] *= -1.0
            inside = wound
        return np.where(inside, -distances, distances), triangles, closest, normals

    def smooth(self, points: Array) -> tuple[Array, IntArray, Array, Array]:
        """As `signed`, with normals interpolated between those of the vertices.

        A plane through the closest place turns without a jump where that place moves from facet to facet.
        """
        signed, triangles, closest, _ = self.signed(points)
        feet = barycentric_matrix(closest, self.surface.triangles[triangles], self.surface.vertices)
        return signed, triangles, closest, self.surface.smooth_normals(feet)

    def ways_out(self, points: Array, directions: Array, most: float) -> tuple[Array, IntArray, Array, Array]:
        """Where points leave the surface in given directions.

        Parameters
        ----------
        points, directions : array (n, 3)
            Points in mm; unit vectors.
        most : float
            Length in mm of a way, at most.

        Returns
        -------
        lengths : array (n,)
            Ways in mm; infinite where none leads out.
        triangles : array (n,) of int
            Triangles in which they end; -1 where none leads out.
        places : array (n, 3)
            Where they end; the point itself where none leads out.
        normals : array (n, 3)
            Unit normals there, interpolated between those of the vertices; the direction where none leads
            out.
        """
        surface = self.surface
        starts, along = (np.ascontiguousarray(a, dtype=np.float64) for a in (points, directions))
        lengths, triangles = ways_out(starts, along, most, surface.vertices, surface.triangles, self._tree)
        out = np.flatnonzero(triangles >= 0)
        places, normals = starts.copy(), along.copy()
        places[out] += lengths[out, None] * along[out]
        feet = barycentric_matrix(places[out], surface.triangles[triangles[out]], surface.vertices)
        normals[out] = surface.smooth_normals(feet)
        return lengths, triangles, places, normals

    def depths(self, points: Array) -> Array:
        """Depths (n,) in mm of points (n, 3) inside the surface, which may cut itself; 0 outside."""
        return np.where(self.surface.contains(points), self.closest(points)[0], 0.0)


def about(points: Array, surface: Surface, near: float) -> IntArray:
    """Points in two boxes of a surface, enlarged: no other point is closer to the surface than `near`.

    One box is along the coordinates, the other along the surface's principal axes: slender organs lie askew.

    Parameters
    ----------
    points : array (n, 3)
        Points in mm.
    surface : Surface
        Surface whose boxes are taken.
    near : float
        Distance in mm by which the boxes are enlarged on each side.

    Returns
    -------
    array (k,) of int
        Indices of the points in both boxes, sorted.
    """
    ids = np.flatnonzero(_within(points, surface.box, near))
    if not len(ids):
        return ids
    axes, box = surface.principal_box
    return ids[_within(points[ids] @ axes, box, near)]


def _within(points: Array, box: tuple[Array, Array], near: float) -> BoolArray:
    """Which points (n, 3) are in a box, given by its least and largest coordinates, enlarged by `near`."""
    low, high = box
    return np.asarray(((points > low - near) & (points < high + near)).all(axis=1))


def _pseudonormals(surface: Surface) -> tuple[Array, Array, Array]:
    """Normals of triangles (k, 3), of their edges from corner i to i + 1 (k, 3, 3), of vertices (n, 3)."""
    normals, edge = surface.triangle_normals(), surface.edge_numbers()
    sums = sums_at(edge, np.repeat(normals, 3, axis=0), int(edge.max()) + 1)
    return normals, sums[edge].reshape(-1, 3, 3), surface.vertex_normals()


@njit(cache=True)
def _normals_at(
    closest: Array,
    triangles: IntArray,
    vertices: Array,
    corners: IntArray,
    normals: tuple[Array, Array, Array],
) -> Array:
    """Unit pseudonormals (n, 3) at closest places (n, 3) in triangles (n,)."""
    face, edge, vertex = normals
    out = np.empty_like(closest)
    for i in range(len(closest)):
        t = triangles[i]
        feature, at = nearest_feature(closest, i, vertices, corners, t)
        for k in range(3):
            if feature == FACE:
                out[i, k] = face[t, k]
            elif feature == EDGE:
                out[i, k] = edge[t, (at + 1) % 3, k]  # the edge opposite to the corner of weight zero
            else:
                out[i, k] = vertex[corners[t, at], k]
        length = np.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2)
        if length > 0:
            for k in range(3):
                out[i, k] /= length
    return out


@njit(cache=True)
def nearest_feature(
    closest: Array, number: int, vertices: Array, corners: IntArray, triangle: int
) -> tuple[int, int]:
    """Whether a place in a triangle is on its face, an edge or a vertex, and which.

    Parameters
    ----------
    closest : array (n, 3)
        Places in mm.
    number : int
        The place in question.
    vertices : array (v, 3)
        Vertices in mm.
    corners : array (t, 3) of int
        Vertices of the triangles.
    triangle : int
        The triangle that the place is in.

    Returns
    -------
    feature : int
        `FACE`, `EDGE` or `VERTEX`.
    corner : int
        The corner of an `EDGE` that is opposite to it, that of a `VERTEX`, 0 for a `FACE`.
    """
    a, b, c = corners[triangle, 0], corners[triangle, 1], corners[triangle, 2]
    xx = xy = yy = px = py = 0.0
    for k in range(3):
        x, y = vertices[b, k] - vertices[a, k], vertices[c, k] - vertices[a, k]
        p = closest[number, k] - vertices[a, k]
        xx += x * x
        xy += x * y
        yy += y * y
        px += p * x
        py += p * y
    squared = max(xx * yy - xy * xy, 1e-300)
    second, third = (yy * px - xy * py) / squared, (xx * py - xy * px) / squared
    first = 1.0 - second - third
    most, least = max(first, second, third), min(first, second, third)
    if most > 1.0 - ON_EDGE:
        return VERTEX, 0 if first == most else (1 if second == most else 2)
    if least < ON_EDGE:
        return EDGE, 0 if first == least else (1 if second == least else 2)
    return FACE, 0


def sample_points(surface: Surface, count: int, seed: int = 0) -> Array:
    """Random points on a surface, uniform over its area.

    Parameters
    ----------
    surface : Surface
        Surface to sample.
    count : int
        Number of points.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    array (count, 3)
        Points in mm.
    """
    random = np.random.default_rng(seed)
    areas = surface.triangle_areas()
    chosen = random.choice(len(areas), size=count, p=areas / areas.sum())
    u, v = np.sqrt(random.random(count)), random.random(count)
    weights = np.stack([1 - u, u * (1 - v), u * v], axis=1)
    return np.einsum("nc,ncd->nd", weights, surface.vertices[surface.triangles[chosen]])


def surface_errors(a: Surface, b: Surface, *, samples: int = 0, seed: int = 0) -> Array:
    """Unsigned distances from one surface to another.

    Parameters
    ----------
    a, b : Surface
        Surfaces from which and to which distances are measured.
    samples : int
        Number of random points on `a` at which to measure; 0 takes the vertices of its triangles.
    seed : int
        Seed of the random points.

    Returns
    -------
    array (k,)
        Distances in mm.
    """
    points = sample_points(a, samples, seed) if samples else a.vertices[np.unique(a.triangles)]
    return Distance(b).closest(points)[0]
