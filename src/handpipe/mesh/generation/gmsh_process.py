"""Fill closed shells with tetrahedra: `python -m handpipe.mesh.generation.gmsh_process input.npz output.npz`.

gmsh is under the GPL; it stays in this process of its own, which exchanges arrays only.
"""

from __future__ import annotations

import sys

import gmsh
import numpy as np
from scipy.spatial import cKDTree

from handpipe.core import Array, IntArray

DELAUNAY = 1  # Gmsh's number of the algorithm
GRADING = 0.5  # growth of the element size per mm of distance from the surface
OPTIMISED = 0.45  # quality of tets below which Gmsh improves them


def mesh_interior(
    vertices: Array, triangles: IntArray, shell: IntArray, edge_length: float
) -> tuple[Array, IntArray]:
    """Vertices (n, 3) and tets (m, 4); the surface's vertices come first and its triangles are kept.

    `shell` (k,) numbers the closed shell of each triangle: number 0 is the outer one, the rest are holes.
    """
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.NumThreads", 1)
        gmsh.option.setNumber("General.Terminal", 1)
        gmsh.option.setNumber("Mesh.Algorithm3D", DELAUNAY)
        gmsh.option.setNumber("Mesh.Optimize", 1)
        gmsh.option.setNumber("Mesh.OptimizeThreshold", OPTIMISED)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
        _add_shells(vertices, triangles, shell)
        size = _size(vertices, triangles, edge_length)
        gmsh.model.mesh.setSizeCallback(lambda dim, tag, x, y, z, lc: size(x, y, z))
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.optimize("", niter=2)
        return _result(len(vertices))
    finally:
        gmsh.finalize()


def _add_shells(vertices: Array, triangles: IntArray, shell: IntArray) -> None:
    """One discrete surface a shell, and the volume between them; vertex v has the tag v + 1."""
    loops = []
    first = 1
    for number in range(shell.max() + 1):
        tag = number + 1
        own = triangles[shell == number]
        used = np.unique(own)
        gmsh.model.addDiscreteEntity(2, tag)
        gmsh.model.mesh.addNodes(2, tag, used + 1, vertices[used].ravel())
        elements = np.arange(first, first + len(own))
        gmsh.model.mesh.addElementsByType(tag, 2, elements, (own + 1).ravel())
        first += len(own)
        loops.append(gmsh.model.geo.addSurfaceLoop([tag]))
    gmsh.model.geo.addVolume(loops)
    gmsh.model.geo.synchronize()


def _size(vertices: Array, triangles: IntArray, edge_length: float):  # type: ignore[no-untyped-def]
    """Size at a point: the surface's own where it is near, `edge_length` in the depth, graded between."""
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    lengths = np.linalg.norm(vertices[start] - vertices[end], axis=1)
    local = np.bincount(start, lengths, len(vertices)) / np.maximum(
        np.bincount(start, minlength=len(vertices)), 1
    )
    tree = cKDTree(vertices)

    def size(x: float, y: float, z: float) -> float:
        distance, nearest = tree.query((x, y, z))
        change = GRADING * distance
        return float(np.clip(edge_length, local[nearest] - change, local[nearest] + change))

    return size


def _result(n_surface: int) -> tuple[Array, IntArray]:
    """All vertices in the order of their tags (the surface's first) and the tets on them."""
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, corners = gmsh.model.mesh.getElementsByType(4)
    order = np.argsort(tags)
    if not np.array_equal(tags[order][:n_surface], np.arange(1, n_surface + 1)):
        raise RuntimeError("gmsh did not keep the surface's vertices")
    tets = np.searchsorted(tags[order], corners).reshape(-1, 4)
    return coordinates.reshape(-1, 3)[order], tets.astype(np.int64)


if __name__ == "__main__":
    source, target = sys.argv[1:]
    with np.load(source) as given:
        arrays = {name: given[name] for name in given.files}
    points, cells = mesh_interior(
        arrays["vertices"], arrays["triangles"], arrays["shell"], float(arrays["edge_length"])
    )
    np.savez(target, vertices=points, tets=cells)
