"""Bodies of known shape, and how far one is from another."""

from __future__ import annotations

import numpy as np
import skfem
import trimesh

from handpipe.core import Array
from handpipe.mesh.generation import remesh, tetrahedralise
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import TetMesh


def bar(cells: tuple[int, int, int], size: tuple[float, float, float]) -> TetMesh:
    """A bar from the origin, five or six tets a cell."""
    axes = [np.linspace(0.0, s, c + 1) for c, s in zip(cells, size, strict=True)]
    mesh = skfem.MeshTet.init_tensor(*axes)
    tets = mesh.t.T.astype(np.int64)
    found = TetMesh(mesh.p.T.copy(), tets)
    flipped = found.volumes() < 0
    tets[flipped] = tets[flipped][:, [0, 2, 1, 3]]
    return TetMesh(found.vertices, tets)


def muscle(edge: float, length: float = 60.0, thickness: float = 7.0) -> TetMesh:
    """A curved, flattened spindle with thin ends, filled with tets of about `edge` mm."""
    sphere = trimesh.creation.icosphere(subdivisions=5)
    x, y, z = np.asarray(sphere.vertices).T
    belly = 0.35 + 0.65 * (1 - x**2)
    shape = np.column_stack([0.5 * length * x, thickness * belly * y, 0.6 * thickness * belly * z])
    shape[:, 1] += 0.1 * length * x**2
    shape[:, 2] += 0.04 * length * x**3
    return tetrahedralise(remesh(Surface(shape, np.asarray(sphere.faces)), edge), edge)


def liver(edge: float, size: float = 110.0) -> TetMesh:
    """A wedge with a notch, of a liver's size in mm, filled with tets of about `edge` mm."""
    sphere = trimesh.creation.icosphere(subdivisions=5)
    x, y, z = np.asarray(sphere.vertices).T
    taper = 0.75 - 0.45 * x
    shape = np.column_stack([0.9 * size * x, 0.62 * size * taper * y, 0.5 * size * taper * z])
    shape[:, 1] += 0.12 * size * np.exp(-(((x - 0.2) / 0.25) ** 2)) * np.where(y < 0, -y, 0.0)
    shape[:, 2] += 0.12 * size * (x**2 - 0.5 * x * y)
    return tetrahedralise(remesh(Surface(shape, np.asarray(sphere.faces)), edge), edge)


def scattered(surface: Surface, count: int, seed: int = 0) -> Array:
    """Points (count, 3) on a surface, about evenly."""
    shell = trimesh.Trimesh(surface.vertices, surface.triangles, process=False)
    dense = np.asarray(trimesh.sample.sample_surface(shell, 12 * count, seed=seed)[0])
    return farthest(dense, count)


def farthest(points: Array, count: int) -> Array:
    """Points, each farthest from those before it."""
    chosen = np.zeros(count, dtype=np.int64)
    nearest = np.full(len(points), np.inf)
    for k in range(1, count):
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[k - 1]], axis=1))
        chosen[k] = int(np.argmax(nearest))
    return points[chosen]


def surface_errors(found: TetMesh, truth: TetMesh) -> Array:
    """Distances in mm of the found boundary's vertices from the true surface, and the other way."""
    here, there = found.boundary(), truth.boundary()
    inside, outside = found.boundary_vertices(), truth.boundary_vertices()
    return np.concatenate(
        [
            Distance(there).closest(found.vertices[inside])[0],
            Distance(here).closest(truth.vertices[outside])[0],
        ]
    )
