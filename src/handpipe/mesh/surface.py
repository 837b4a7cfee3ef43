"""A triangle surface: its measures, and how it is read and written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import igl
import meshio
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from handpipe.artifacts import atomic
from handpipe.errors import InputError
from handpipe.mesh.rigid import RigidTransform

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Surface:
    """Vertices (n, 3) in mm and triangles (k, 3), counter-clockwise seen from outside."""

    vertices: Array
    triangles: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "vertices", np.ascontiguousarray(self.vertices, dtype=np.float64).reshape(-1, 3)
        )
        object.__setattr__(
            self, "triangles", np.ascontiguousarray(self.triangles, dtype=np.int64).reshape(-1, 3)
        )

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
        return _unit(self._area_vectors())

    @cached_property
    def _vertex_normals(self) -> Array:
        angles = corner_angles(self.vertices, self.triangles)
        weighted = angles[:, :, None] * self.triangle_normals()[:, None, :]
        return _unit(sums_at(self.triangles.ravel(), weighted.reshape(-1, 3), len(self.vertices)))

    def vertex_normals(self) -> Array:
        """Unit normals (n, 3), triangle normals weighted by their angle at the vertex."""
        return self._vertex_normals

    def smooth_normals(self, feet: sparse.csr_matrix) -> Array:
        """Unit normals (k, 3) at places that weights (k, n) of the vertices make up, between the vertices'
        normals: along the surface they turn without a jump from facet to facet.
        """
        return _unit(feet @ self.vertex_normals())

    def contains(self, points: Array) -> NDArray[np.bool_]:
        """Which points (n,) of (n, 3) are inside: about which the surface winds by more than a half.

        Holes of an open surface count as closed (Jacobson et al. 2013, Robust inside-outside segmentation).
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
        directed = directed_edges(self.triangles)
        edges, counts = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
        return edges, counts

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

    def is_closed(self) -> bool:
        """Whether every edge has two triangles that run along it in opposite directions."""
        directed = directed_edges(self.triangles)
        if len(directed) == 0 or not (self._edges[1] == 2).all():
            return False
        return len(np.unique(directed, axis=0)) == len(directed)

    def moved(self, vertices: Array) -> Surface:
        """The same triangles on other vertices (n, 3)."""
        return Surface(vertices, self.triangles)

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


def _unit(vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(lengths > 0, lengths, 1.0)


def component_labels(triangles: IntArray) -> IntArray:
    """The number (k,), from 0, of the part connected by edges to which each triangle belongs."""
    return np.asarray(igl.facet_components(triangles)[1], dtype=np.int64).reshape(-1)


def directed_edges(triangles: IntArray) -> IntArray:
    """Directed edges (3 k, 2) of triangles (k, 3): all first edges, all second ones, all third ones."""
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def sums_at(places: IntArray, vectors: Array, count: int) -> Array:
    """Sums (count, 3) of the vectors (k, 3) that belong to each of so many places (k,)."""
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
    """Each surface moved by the transform of its name, as bones are into a pose."""
    return {name: s.moved(transforms[name](s.vertices)) for name, s in surfaces.items()}


def concatenate(surfaces: list[Surface]) -> Surface:
    """Several surfaces as one, vertices in the order given."""
    starts = np.cumsum([0, *(len(s.vertices) for s in surfaces)])
    triangles = [s.triangles + start for s, start in zip(surfaces, starts, strict=False)]
    return Surface(np.concatenate([s.vertices for s in surfaces]), np.concatenate(triangles))


def read_surface(path: str | Path, *, closed: bool = False) -> Surface:
    """Read PLY, OBJ or STL in mm; vertices keep their order (STL, which repeats them, is merged).

    With `closed`, the surface must be closed, and is turned to face outwards. Raises `InputError` where
    the file is missing or unreadable, has no triangles, has NaN coordinates, is in metres, or is open.
    """
    mesh = _read(Path(path))
    triangles = [block.data for block in mesh.cells if block.type == "triangle"]
    quads = [block.data for block in mesh.cells if block.type == "quad"]
    triangles += [part for quad in quads for part in (quad[:, [0, 1, 2]], quad[:, [0, 2, 3]])]
    if sum(len(part) for part in triangles) == 0:
        raise InputError(path, "triangles", "there are none", "Export a triangle surface, not points")
    surface = Surface(mesh.points[:, :3], np.concatenate(triangles))
    _check(surface, path)
    if closed:
        require_closed(surface, path)
        return surface if surface.volume() > 0 else surface.flipped()
    return surface


def _read(path: Path) -> meshio.Mesh:
    if not path.exists():
        raise InputError(path, "file", "does not exist", "Check the path")
    if path.suffix.lower() not in (".ply", ".obj", ".stl"):
        raise InputError(path, "file", "is not PLY, OBJ or STL", "Convert it to one of these")
    try:
        return meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio exits or raises anything on a malformed file
        raise InputError(path, "content", f"cannot be read ({error})", "Export the surface again") from error


def _check(surface: Surface, path: str | Path) -> None:
    bad = np.flatnonzero(~np.isfinite(surface.vertices).all(axis=1))
    if len(bad):
        problem = f"NaN or infinite coordinates in {len(bad)} vertices, the first is vertex {bad[0]}"
        raise InputError(path, "vertices", problem, "Remove these vertices or export the surface again")
    if surface.triangles.min() < 0 or surface.triangles.max() >= len(surface.vertices):
        raise InputError(path, "triangles", "name vertices that do not exist", "Export the surface again")
    extent = np.ptp(surface.vertices, axis=0).max()
    if extent < 1:
        raise InputError(path, "units", f"looks like metres (extent {extent:.3g})", "Give mm: scale by 1000")


def require_closed(surface: Surface, source: str | Path) -> None:
    """Raise `InputError` naming boundary edges and where they are, unless the surface is closed."""
    if surface.is_closed():
        return
    boundary = surface.boundary_edges()
    if len(boundary):
        place = ", ".join(f"{c:.1f}" for c in surface.vertices[boundary[0]].mean(axis=0))
        problem = f"is open: {len(boundary)} boundary edges, the first near ({place})"
    else:
        problem = "has edges with more than two triangles, or neighbours that face opposite ways"
    raise InputError(
        source, "triangles", problem, "Close it with handpipe.mesh.repair.repair or in a mesh editor"
    )


def write_surface(path: str | Path, surface: Surface) -> None:
    """Write PLY, OBJ or STL, by suffix, atomically; coordinates in mm."""
    mesh = meshio.Mesh(surface.vertices, [("triangle", surface.triangles.astype(np.int32))])
    with atomic(path) as temporary:
        if Path(path).suffix.lower() == ".obj":
            meshio.write(temporary, mesh)
        else:
            meshio.write(temporary, mesh, binary=True)
