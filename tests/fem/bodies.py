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
