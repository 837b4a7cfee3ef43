"""A triangle surface and its measures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import igl
import numpy as np
from scipy import sparse

from handpipe.core import Array, BoolArray, InputError, IntArray, RigidTransform, unit_vectors
from handpipe.mesh.surfaces.triangle_tree import ordered


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle surface in space.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm; kept as contiguous float64.
    triangles : array (k, 3) of int
        Vertices of each triangle, counter-clockwise seen from outside; kept as contiguous int64.
    """

    vertices: Array
    triangles: IntArray

    def __post_init__(self) -> None:
        """Stores contiguous arrays of the documented types and shapes."""
        object.__setattr__(
            self, "vertices", np.ascontiguousarray(self.vertices, dtype=np.float64).reshape(-1, 3)
        )
        object.__setattr__(
            self, "triangles", np.ascontiguousarray(self.triangles, dtype=np.int64).reshape(-1, 3)
        )

    def checked(self, source: str | Path) -> Surface:
        """The surface itself, if it is valid.

        Parameters
        ----------
        source : path
            File or origin that an error names.

        Returns
        -------
        Surface

        Raises
        ------
        InputError
            Where a coordinate is not finite, there are no triangles, or one names a vertex that is missing.
        """
        if not np.isfinite(self.vertices).all():
            raise InputError(source, "vertices", "NaN or infinite coordinates", "Make the surface again")
        cells = self.triangles
        if len(cells) == 0 or cells.min() < 0 or cells.max() >= len(self.vertices):
            problem = "none, or they name vertices that do not exist"
            raise InputError(source, "triangles", problem, "Make the surface again")
        return self

    def _area_vectors(self) -> Array:
        a, b, c = np.moveaxis(self.vertices[self.triangles], 1, 0)
        return 0.5 * np.cross(b - a, c - a)

    def volume(self) -> float:
        """Enclosed volume in mm^3 by the divergence theorem; negative where the triangles face inwards."""
        corner = self.vertices[self.triangles[:, 0]] - self.vertices.mean(axis=0)
        return float(np.einsum("ij,ij->", corner, self._area_vectors()) / 3)

    def area(self) -> float:
        """Area in mm^2."""
        return float(self.triangle_areas().sum())

    def triangle_areas(self) -> Array:
        """Areas (k,) in mm^2."""
        return np.linalg.norm(self._area_vectors(), axis=1)

    def centroid(self) -> Array:
        """Centroid (3,) of the enclosed volume."""
        middle = self.vertices.mean(axis=0)
        a, b, c = np.moveaxis(self.vertices[self.triangles] - middle, 1, 0)
        six_volumes = np.einsum("ij,ij->i", a, np.cross(b, c))
        return middle + six_volumes @ (a + b + c) / (4 * six_volumes.sum())

    def triangle_normals(self) -> Array:
        """Unit normals (k, 3); zero for a triangle without area."""
        return unit_vectors(self._area_vectors())

    @cached_property
    def _vertex_normals(self) -> Array:
        angles = corner_angles(self.vertices, self.triangles)
        weighted = angles[:, :, None] * self.triangle_normals()[:, None, :]
        return unit_vectors(sums_at(self.triangles.ravel(), weighted.reshape(-1, 3), len(self.vertices)))

    def vertex_normals(self) -> Array:
        """Unit normals (n, 3), triangle normals weighted by their angle at the vertex."""
        return self._vertex_normals

    def smooth_normals(self, feet: sparse.csr_matrix) -> Array:
        """Normals interpolated between the vertices' normals.

        Along the surface they turn without a jump from facet to facet.

        Parameters
        ----------
        feet : sparse matrix (k, n)
            Weights of the vertices that make up each place, as `barycentric_matrix` gives them.

        Returns
        -------
        array (k, 3)
            Unit normals.
        """
        return unit_vectors(feet @ self.vertex_normals())

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """Least and largest coordinates (3,) in mm of the vertices."""
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    @cached_property
    def principal_box(self) -> tuple[Array, tuple[Array, Array]]:
        """Principal axes of the vertices, as columns (3, 3), and the box of the coordinates along them."""
        off = self.vertices - self.vertices.mean(axis=0)
        axes = np.linalg.eigh(off.T @ off)[1]
        along = self.vertices @ axes
        return axes, (along.min(axis=0), along.max(axis=0))

    def contains(self, points: Array) -> BoolArray:
        """Which points are inside: those with a winding number above one half.

        Holes of an open surface count as closed.

        Parameters
        ----------
        points : array (p, 3)
            Points in mm.

        Returns
        -------
        array (p,) of bool

        References
        ----------
        Jacobson et al. 2013, Robust inside-outside segmentation.
        """
        queries = np.ascontiguousarray(points, dtype=np.float64)
        return np.asarray(self._windings.winding_number(queries) > 0.5)

    @cached_property
    def _windings(self) -> igl.FastWindingNumberBVH:
        tree = igl.FastWindingNumberBVH()
        tree.init(self.vertices, self.triangles)
        return tree

    @cached_property
    def _edges(self) -> tuple[IntArray, IntArray]:
        return unique_pairs(np.sort(directed_edges(self.triangles), axis=1))

    def edges(self) -> IntArray:
        """Undirected edges (e, 2), each once, smaller index first, sorted."""
        return self._edges[0]

    def edge_lengths(self) -> Array:
        """Lengths (e,) in mm of `edges()`."""
        ends = self.vertices[self.edges()]
        return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)

    def boundary_edges(self) -> IntArray:
        """Edges (e, 2) that belong to one triangle only."""
        edges, counts = self._edges
        return edges[counts == 1]

    def crowded_edges(self) -> IntArray:
        """Edges (e, 2) along which several triangles run in the same direction."""
        edges, counts = unique_pairs(directed_edges(self.triangles))
        return edges[counts > 1]

    def is_closed(self) -> bool:
        """Whether every edge has two triangles that run along it in opposite directions."""
        if len(self.triangles) == 0 or not (self._edges[1] == 2).all():
            return False
        return len(self.crowded_edges()) == 0

    def edge_numbers(self) -> IntArray:
        """For each triangle's edge from corner i to i + 1 (3 k,), the number of its undirected edge."""
        if "edges" not in self._of_triangles:
            first = self.triangles.reshape(-1)
            second = np.roll(self.triangles, -1, axis=1).reshape(-1)
            keys = np.minimum(first, second) * len(self.vertices) + np.maximum(first, second)
            self._of_triangles["edges"] = np.unique(keys, return_inverse=True)[1].reshape(-1)
        return self._of_triangles["edges"]

    def tree(self) -> tuple[IntArray, IntArray]:
        """Order (k,) of the triangles in a tree and its nodes (m, 3), found once for all moved copies."""
        if "order" not in self._of_triangles:
            found = ordered(self.vertices, self.triangles)
            self._of_triangles["order"], self._of_triangles["nodes"] = found
        return self._of_triangles["order"], self._of_triangles["nodes"]

    @cached_property
    def _of_triangles(self) -> dict[str, IntArray]:
        """What was computed of the triangles alone, which moved surfaces share."""
        return {}

    def moved(self, vertices: Array) -> Surface:
        """The same triangles on other vertices (n, 3)."""
        other = Surface(vertices, self.triangles)
        other.__dict__["_of_triangles"] = self._of_triangles
        return other

    def flipped(self) -> Surface:
        """The same surface facing the other way."""
        return Surface(self.vertices, self.triangles[:, ::-1])

    def compact(self) -> Surface:
        """Without the vertices that no triangle uses; the others keep their order."""
        used, inverse = np.unique(self.triangles, return_inverse=True)
        return Surface(self.vertices[used], inverse.reshape(-1, 3))

    def components(self) -> list[Surface]:
        """The parts connected by edges, largest area first."""
        labels = component_labels(self.triangles)
        parts = [
            Surface(self.vertices, self.triangles[labels == i]).compact() for i in range(labels.max() + 1)
        ]
        return sorted(parts, key=lambda part: -part.area())

    def largest_component(self) -> Surface:
        """The connected part of largest area."""
        return self.components()[0]


def component_labels(triangles: IntArray) -> IntArray:
    """The connected part to which each triangle belongs; parts are connected by edges.

    Parameters
    ----------
    triangles : array (k, 3) of int
        Vertices of each triangle.

    Returns
    -------
    array (k,) of int
        Numbers of the parts, from 0.
    """
    return np.asarray(igl.facet_components(triangles)[1], dtype=np.int64).reshape(-1)


def directed_edges(triangles: IntArray) -> IntArray:
    """The directed edges of triangles.

    Parameters
    ----------
    triangles : array (k, 3) of int
        Vertices of each triangle.

    Returns
    -------
    array (3 k, 2) of int
        Start and end of each edge: first edges of all triangles, then all second edges, then all third ones.
    """
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def unique_pairs(pairs: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs of numbers, each once.

    Parameters
    ----------
    pairs : array (p, 2) of int
        Numbers from 0.

    Returns
    -------
    pairs : array (u, 2) of int
        Sorted by the first number, then by the second.
    counts : array (u,) of int
        How often each was there.
    """
    # One number a pair: rows as keys are sorted ten times more slowly.
    count = int(pairs.max(initial=0)) + 1
    keys, counts = np.unique(pairs[:, 0] * count + pairs[:, 1], return_counts=True)
    return np.stack(np.divmod(keys, count), axis=1), counts


def sums_at(places: IntArray, vectors: Array, count: int) -> Array:
    """Sums (count, 3) of vectors (k, 3) by their places (k,), numbers below `count`."""
    return np.stack([np.bincount(places, column, count) for column in vectors.T], axis=1)


def corner_angles(vertices: Array, triangles: IntArray) -> Array:
    """Angles (k, 3) in rad at each triangle's corners."""
    points = vertices[triangles]
    angles = np.empty(triangles.shape)
    for corner in range(3):
        u = points[:, (corner + 1) % 3] - points[:, corner]
        v = points[:, (corner + 2) % 3] - points[:, corner]
        angles[:, corner] = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
    return angles


def each_moved(
    surfaces: Mapping[str, Surface], transforms: Mapping[str, RigidTransform]
) -> dict[str, Surface]:
    """Each surface moved by the transform of its name, as bones are moved into a pose.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        Surfaces by name.
    transforms : mapping of str to RigidTransform
        A transform for each of these names, and perhaps for others.

    Returns
    -------
    dict of str to Surface
        Moved surfaces by name, in the order of `surfaces`.
    """
    return {name: s.moved(transforms[name](s.vertices)) for name, s in surfaces.items()}


def concatenate(surfaces: list[Surface]) -> Surface:
    """Several surfaces as one.

    Parameters
    ----------
    surfaces : list of Surface
        At least one surface.

    Returns
    -------
    Surface
        All vertices and all triangles in the order of the surfaces; equal vertices are not merged.
    """
    starts = np.cumsum([0, *(len(s.vertices) for s in surfaces)])
    triangles = [s.triangles + start for s, start in zip(surfaces, starts, strict=False)]
    return Surface(np.concatenate([s.vertices for s in surfaces]), np.concatenate(triangles))


def place_in_words(point: Array) -> str:
    """A point as text for messages.

    Parameters
    ----------
    point : array (3,)
        Its coordinates in mm.

    Returns
    -------
    str
        Such as "(1.0, 2.0, 3.0)".
    """
    return f"({', '.join(f'{c:.1f}' for c in point)})"


def require_closed(surface: Surface, source: str | Path) -> None:
    """Require that a surface is closed.

    Parameters
    ----------
    surface : Surface
        The surface.
    source : path
        File or origin that an error names.

    Raises
    ------
    InputError
        Where it is open, or its triangles face opposite ways; with the place of the first such edge.
    """
    if surface.is_closed():
        return
    boundary = surface.boundary_edges()
    if len(boundary):
        place = place_in_words(surface.vertices[boundary[0]].mean(axis=0))
        problem = f"is open: {len(boundary)} boundary edges, the first near {place}"
    else:
        place = place_in_words(surface.vertices[surface.crowded_edges()[0]].mean(axis=0))
        problem = (
            f"has edges with more than two triangles, or neighbours that face opposite ways, near {place}"
        )
    raise InputError(
        source, "triangles", problem, "Close it with handpipe.mesh.generation.repair or in a mesh editor"
    )
