"""Shapes whose measures are known."""

from __future__ import annotations

import igl
import numpy as np

from handpipe.mesh.generation.implicit import Grid, isosurface
from handpipe.mesh.generation.remeshing import remesh
from handpipe.mesh.surfaces.surface import Surface
from handpipe.mesh.tets.tetrahedra import TetMesh

FINGERS = 9.0  # mm between the middles of two fingers of 4 mm radius


def sphere(radius: float = 10.0, levels: int = 4) -> Surface:
    vertices, triangles = igl.icosahedron()
    surface = Surface(vertices, triangles)
    for _ in range(levels):
        finer, split = igl.upsample(surface.vertices, surface.triangles)
        surface = Surface(finer / np.linalg.norm(finer, axis=1, keepdims=True), split)
    surface = surface.moved(
        radius * surface.vertices / np.linalg.norm(surface.vertices, axis=1, keepdims=True)
    )
    return surface if surface.volume() > 0 else surface.flipped()


def box(size: tuple[float, float, float] = (4.0, 3.0, 2.0)) -> Surface:
    """The box from the origin to `size`, two triangles a side."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * np.array(size)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return Surface(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def fork(radius: float, apart: float, edge: float, length: float = 20.0) -> Surface:
    """Two round prongs along x, their axes `apart` mm to either side of the middle, on a plate 3 mm thick."""
    wide = apart + radius
    grid = Grid.around(np.array([[-4, -wide, -radius], [length + radius, wide, radius]]), 1.0, 0.5)
    x, y, z = grid.points().T
    prongs = np.hypot(np.hypot(np.abs(y) - apart, z), np.maximum(x - length, np.minimum(x, 0))) - radius
    plate = np.max([np.abs(x + 1) - 3, np.abs(y) - wide, np.abs(z) - 1.5], axis=0)
    return remesh(isosurface(np.minimum(prongs, plate), grid), edge)


def box_tets(n: int = 3, seed: int = 0) -> TetMesh:
    """The unit cube cut into n^3 cells of six tets each, inner vertices moved at random."""
    vertices = np.indices((n + 1, n + 1, n + 1)).reshape(3, -1).T / n
    steps = np.array([(n + 1) ** 2, n + 1, 1])
    first = (np.indices((n, n, n)).reshape(3, -1).T @ steps)[:, None]
    tets = []
    for order in ([0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]):
        path = first + np.concatenate([[0], np.cumsum(steps[order])])
        even = np.linalg.det(np.eye(3)[order]) > 0
        tets.append(path if even else path[:, [0, 2, 1, 3]])
    inner = ((vertices > 0) & (vertices < 1)).all(axis=1)
    vertices[inner] += np.random.default_rng(seed).uniform(-0.15, 0.15, (inner.sum(), 3)) / n
    return TetMesh(vertices, np.concatenate(tets))


def smallest_angles(surface: Surface) -> np.ndarray:
    """Smallest angle of each triangle in degrees, by the law of cosines."""
    a, b, c = np.moveaxis(surface.vertices[surface.triangles], 1, 0)
    la, lb, lc = (np.linalg.norm(e, axis=1) for e in (c - b, a - c, b - a))
    cosines = [(y**2 + z**2 - x**2) / (2 * y * z) for x, y, z in ((la, lb, lc), (lb, lc, la), (lc, la, lb))]
    return np.degrees(np.arccos(np.clip(cosines, -1, 1))).min(axis=0)


def folded_ball() -> Surface:
    """A ball of 5 mm whose upper cap is pushed through its far side, where it comes out inside out."""
    ball = sphere(5.0, 4)
    folded = ball.vertices.copy()
    folded[folded[:, 2] > 4.0] -= [0.0, 0.0, 11.0]
    return ball.moved(folded)


def capsule(points: np.ndarray, a: list[float], b: list[float], radius: float) -> np.ndarray:
    """Distances (n,) of points from a capsule between two places."""
    start, along = np.array(a), np.subtract(b, a)
    share = np.clip((points - start) @ along / (along @ along), 0, 1)
    return np.linalg.norm(points - start - share[:, None] * along, axis=1) - radius


def two_fingers(*bridges: float, radius: float = 0.8) -> Surface:
    """Two fingers along x on one palm, 1 mm apart; bridges at these x."""
    grid = Grid(np.array([-8.0, -6.0, -6.0]), 0.5, (96, 44, 24))
    points = grid.points()
    parts = [capsule(points, [0, y, 0], [30, y, 0], 4.0) for y in (0.0, FINGERS)]
    parts.append(capsule(points, [0, 0, 0], [0, FINGERS, 0], 5.0))
    parts += [capsule(points, [x, 0, 0], [x, FINGERS, 0], radius) for x in bridges]
    return isosurface(np.min(parts, axis=0).reshape(grid.shape), grid).largest_component()
