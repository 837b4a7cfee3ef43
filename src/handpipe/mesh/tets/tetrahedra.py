"""A tetrahedral mesh: its measures, its boundary and its checks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, BoolArray, InputError, IntArray
from handpipe.mesh.surfaces.surface import Surface

# The face opposite to each corner, seen counter-clockwise from outside a tet of positive volume.
FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A tetrahedral mesh.

    Parameters
    ----------
    vertices : array (n, 3)
        Positions in mm; kept as contiguous float64.
    tets : array (m, 4) of int
        Vertices of each tet in the order that makes its volume positive (`checked` tests that); kept as
        contiguous int64.
    """

    vertices: Array
    tets: IntArray

    def __post_init__(self) -> None:
        """Stores contiguous arrays of the documented types and shapes."""
        object.__setattr__(
            self, "vertices", np.ascontiguousarray(self.vertices, dtype=np.float64).reshape(-1, 3)
        )
        object.__setattr__(self, "tets", np.ascontiguousarray(self.tets, dtype=np.int64).reshape(-1, 4))

    def volumes(self) -> Array:
        """Signed volumes (m,) in mm^3."""
        a, b, c, d = np.moveaxis(self.vertices[self.tets], 1, 0)
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6

    def moved(self, vertices: Array) -> TetMesh:
        """The same tets on other vertices (n, 3)."""
        return TetMesh(vertices, self.tets)

    def part(self, chosen: IntArray | BoolArray) -> tuple[TetMesh, IntArray]:
        """Some of the tets as a mesh of their own.

        Parameters
        ----------
        chosen : array of int, or array (m,) of bool
            Indices of the tets, or a mask.

        Returns
        -------
        part : TetMesh
            The tets with the vertices that they use.
        vertices : array (k,) of int
            Index in this mesh of each vertex of the part.
        """
        used, tets = np.unique(self.tets[chosen], return_inverse=True)
        return TetMesh(self.vertices[used], tets.reshape(-1, 4)), used

    def edge_length(self) -> float:
        """Typical edge length in mm: of the regular tet that has the median volume."""
        return float(np.cbrt(6 * np.sqrt(2) * np.median(self.volumes())))

    def boundary_faces(self) -> tuple[IntArray, IntArray]:
        """Triangles (k, 3) that belong to one tet only, facing outwards, and that tet (k,)."""
        faces = self.tets[:, FACES].reshape(-1, 3)
        _, index, counts = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        outer = np.sort(index[counts == 1])
        return faces[outer], outer // 4

    def boundary(self) -> Surface:
        """The boundary facing outwards; its triangles index this mesh's vertices, all of which it carries."""
        return Surface(self.vertices, self.boundary_faces()[0])

    def boundary_vertices(self) -> IntArray:
        """Indices of the vertices on the boundary, sorted."""
        return np.unique(self.boundary_faces()[0])

    def dihedral_angles(self) -> Array:
        """Dihedral angles (m, 6) in degrees."""
        corners = self.vertices[self.tets[:, FACES]]
        normals = np.cross(corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
        first, second = np.triu_indices(4, 1)
        cosine = -np.einsum("mpi,mpi->mp", normals[:, first], normals[:, second])
        return np.degrees(np.arccos(np.clip(cosine, -1, 1)))

    def smallest_dihedral(self) -> float:
        """Smallest dihedral angle of all tets in degrees."""
        return float(self.dihedral_angles().min())

    def checked(self, source: str | Path) -> TetMesh:
        """The mesh itself, if it is valid.

        Parameters
        ----------
        source : path
            File or origin that an error names.

        Returns
        -------
        TetMesh

        Raises
        ------
        InputError
            Where a vertex is missing or NaN, there are no tets, or a tet is inverted or flat.
        """
        if not np.isfinite(self.vertices).all():
            raise InputError(source, "vertices", "NaN or infinite coordinates", "Make the mesh again")
        if len(self.tets) == 0 or self.tets.min() < 0 or self.tets.max() >= len(self.vertices):
            raise InputError(
                source, "tets", "none, or they name vertices that do not exist", "Make the mesh again"
            )
        bad = np.flatnonzero(self.volumes() <= 0)
        if len(bad):
            problem = f"{len(bad)} of {len(self.tets)} inverted or flat, the first is tet {bad[0]}"
            raise InputError(
                source, "tets", problem, "Reorder two of their vertices, or mesh the surface again"
            )
        return self
