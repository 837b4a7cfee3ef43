"""Small bodies that several tests share."""

from __future__ import annotations

import numpy as np
import skfem


def box(size: tuple[float, float, float], cells: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and positive tets (m, 4) of a box from the origin."""
    axes = (np.linspace(0, s, c + 1) for s, c in zip(size, cells, strict=True))
    mesh = skfem.MeshTet.init_tensor(*axes)
    vertices, tets = mesh.p.T.copy(), mesh.t.T.astype(np.int64)
    corners = vertices[tets]
    negative = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    tets[negative] = tets[negative][:, [0, 1, 3, 2]]
    return vertices, tets


def sphere(radius: float, subdivisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and outward triangles of a sphere about the origin."""
    import trimesh

    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)


def box_surface(
    size: tuple[float, float, float], low: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and outward triangles of a box with its lowest corner at `low`."""
    import trimesh

    mesh = trimesh.creation.box(extents=size)
    return np.array(mesh.vertices) + np.array(low) + np.array(size) / 2, np.array(mesh.faces, dtype=np.int64)


def cuts(vertices: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether a surface cuts itself: segments against triangles by Moeller and Trumbore's test, all pairs."""
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    edges = edges[np.argsort(vertices[edges].mean(axis=1)[:, 0])]
    corners = vertices[triangles]
    for start in range(0, len(edges), 100):
        ends = edges[start : start + 100]
        low, high = vertices[ends].min(axis=(0, 1)), vertices[ends].max(axis=(0, 1))
        near = triangles[((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)]
        a, b, c = (vertices[near[:, i]] for i in range(3))
        origin, along = vertices[ends[:, 0]][:, None], (vertices[ends[:, 1]] - vertices[ends[:, 0]])[:, None]
        p = np.cross(along, c - a)
        determinant = np.einsum("etc,tc->et", p, b - a)
        determinant[np.abs(determinant) < 1e-14] = np.inf
        to_origin = origin - a
        q = np.cross(to_origin, b - a)
        u = np.einsum("etc,etc->et", to_origin, p) / determinant
        v = np.einsum("etc,etc->et", np.broadcast_to(along, q.shape), q) / determinant
        t = np.einsum("etc,tc->et", q, c - a) / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1) & np.isfinite(determinant)
        apart = (near[None] != ends[:, :1, None]) & (near[None] != ends[:, 1:, None])
        if (hit & apart.all(axis=2)).any():
            return True
    return False
