"""The space between skin and bones as tets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import igl
import numpy as np
from numpy.typing import NDArray

from handpipe.mesh.meshing import tetrahedralise
from handpipe.mesh.surface import Surface, concatenate
from handpipe.mesh.tetrahedra import TetMesh

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Domain:
    """Tets between skin and bones; vertices (s,) on the skin, and on each bone's surface."""

    mesh: TetMesh
    skin: IntArray
    bones: dict[str, IntArray]

    @staticmethod
    def between(skin: Surface, bones: Mapping[str, Surface], edge_length: float) -> Domain:
        """Tets of about `edge_length` mm; the surfaces' triangles are kept.

        Bones lie inside the skin and apart from one another. Raises `InputError` where surfaces are open or
        meet.
        """
        mesh = tetrahedralise(concatenate([skin, *(b.flipped() for b in bones.values())]), edge_length)
        starts = np.cumsum([len(skin.vertices), *(len(b.vertices) for b in bones.values())])
        on_bones = [np.arange(a, b) for a, b in zip(starts[:-1], starts[1:], strict=True)]
        return Domain(mesh, np.arange(len(skin.vertices)), dict(zip(bones, on_bones, strict=True)))


class Locator:
    """Finds the tets around points, by a tree that is built once."""

    def __init__(self, mesh: TetMesh) -> None:
        self.mesh = mesh
        self._tree = igl.AABB()
        self._tree.init(mesh.vertices, mesh.tets)

    def tets(self, points: Array) -> IntArray:
        """The tet (n,) around each of points (n, 3), -1 outside the mesh."""
        queries = np.ascontiguousarray(points, dtype=np.float64)
        found = igl.in_element(self.mesh.vertices, self.mesh.tets, queries, self._tree)
        return np.asarray(found, dtype=np.int64).reshape(-1)
