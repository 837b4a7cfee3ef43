"""One conforming mesh of several bodies, from the closed surfaces between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from handpipe.core import IntArray
from handpipe.mesh.generation import tetrahedralise
from handpipe.mesh.surfaces import Surface, concatenate
from handpipe.mesh.tets import TetMesh


def fill(
    surfaces: Mapping[str, Surface], regions: Mapping[str, tuple[str, Sequence[str]]], edge_length: float
) -> tuple[TetMesh, IntArray, dict[str, IntArray]]:
    """Tets of about `edge_length` mm in each region, which is what lies in one surface and outside of others.

    Surfaces are closed, face outwards and do not meet; their triangles are kept by the meshes on both sides,
    so that these fit. Returns the mesh, the number (m,) of each tet's region, and each surface's vertices.
    """
    starts = np.cumsum([0, *(len(s.vertices) for s in surfaces.values())])
    on = {name: np.arange(a, b) for name, a, b in zip(surfaces, starts[:-1], starts[1:], strict=True)}
    vertices, tets, labels = [concatenate(list(surfaces.values())).vertices], [], []
    count = int(starts[-1])
    for number, (outer, holes) in enumerate(regions.values()):
        walls = [surfaces[outer], *(surfaces[hole].flipped() for hole in holes)]
        mesh = tetrahedralise(concatenate(walls), edge_length)
        shared = np.concatenate([on[outer], *(on[hole] for hole in holes)])
        inside = mesh.vertices[len(shared) :]
        tets.append(np.concatenate([shared, count + np.arange(len(inside))])[mesh.tets])
        labels.append(np.full(len(mesh.tets), number))
        vertices.append(inside)
        count += len(inside)
    return TetMesh(np.concatenate(vertices), np.concatenate(tets)).checked("fill"), np.concatenate(labels), on
