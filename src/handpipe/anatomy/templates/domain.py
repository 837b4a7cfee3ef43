"""The space between skin and bones as tets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from handpipe.anatomy.improvement.splitting import MarkedEdges, bisect
from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.generation import tetrahedralise
from handpipe.mesh.surfaces import Surface, concatenate
from handpipe.mesh.tets import EDGES, TetMesh

TOO_LONG = 1.4  # largest length of an edge, over its wanted size
GROWTH = 0.6  # of sizes, per mm of distance from the points that are refined
MOST_HALVINGS = 40  # rounds of halving long edges


@dataclass(frozen=True, eq=False)
class Domain:
    """Tets between skin and bones.

    Parameters
    ----------
    mesh : TetMesh
        Tets in mm.
    skin : array (s,)
        Indices of the vertices on the skin.
    bones : dict of str to array (b,)
        Indices of the vertices on the surface of each bone.
    """

    mesh: TetMesh
    skin: IntArray
    bones: dict[str, IntArray]

    @staticmethod
    def between(skin: Surface, bones: Mapping[str, Surface], edge_length: float) -> Domain:
        """Tets between a skin and bones, which keep the triangles of both.

        Parameters
        ----------
        skin : Surface
            Closed surface in mm.
        bones : mapping of str to Surface
            Closed surfaces in mm, inside the skin and apart from one another.
        edge_length : float
            Approximate edge length in mm.

        Returns
        -------
        Domain
            The skin's vertices come first, then those of each bone.

        Raises
        ------
        InputError
            Where surfaces are open or meet.
        """
        mesh = tetrahedralise(concatenate([skin, *(b.flipped() for b in bones.values())]), edge_length)
        starts = np.cumsum([len(skin.vertices), *(len(b.vertices) for b in bones.values())])
        on_bones = [np.arange(a, b) for a, b in zip(starts[:-1], starts[1:], strict=True)]
        return Domain(mesh, np.arange(len(skin.vertices)), dict(zip(bones, on_bones, strict=True)))

    def refined(self, points: Array, edge_length: float | Array) -> Domain:
        """Domain with finer tets around points.

        The longest edges are halved; the domain's vertices keep their numbers. Sizes grow with the distance
        from the points.

        Parameters
        ----------
        points : array (p, 3)
            Points in mm.
        edge_length : float or array (p,)
            Approximate edge length in mm at the points.

        Returns
        -------
        Domain
            New vertices come after those of this domain.
        """
        vertices, tets, skin, bones = self.mesh.vertices, self.mesh.tets, self.skin, self.bones
        lengths = np.broadcast_to(edge_length, len(points))
        trees = {fine: cKDTree(points[lengths == fine]) for fine in np.unique(lengths)}
        for _ in range(MOST_HALVINGS):
            ends = vertices[tets[:, EDGES]]
            length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
            middles = vertices[tets].mean(axis=1)
            size = np.min([fine + GROWTH * tree.query(middles)[0] for fine, tree in trees.items()], axis=0)
            marked = (length > TOO_LONG * size[:, None]) & (length == length.max(axis=1, keepdims=True))
            if not marked.any():
                break
            edges = MarkedEdges.number(tets, marked, len(vertices)).in_all(tets, len(vertices))
            boundary = _boundary_edges(TetMesh(vertices, tets), edges.ends)
            new = len(vertices) + np.arange(len(edges.ends))
            skin, *others = (
                np.concatenate([on, new[boundary & np.isin(edges.ends, on).all(axis=1)]])
                for on in (skin, *bones.values())
            )
            bones = dict(zip(bones, others, strict=True))
            tets, _ = bisect(tets, edges, edges.ranks(vertices), len(vertices))
            vertices = np.concatenate([vertices, vertices[edges.ends].mean(axis=1)])
        return Domain(TetMesh(vertices, tets), skin, bones)

    def edge_length(self) -> float:
        """Typical edge length in mm: of the regular tet that has the median volume."""
        return self.mesh.edge_length()


def _boundary_edges(mesh: TetMesh, edges: IntArray) -> BoolArray:
    """Whether each of edges (e, 2), smaller number first, is one of a boundary face."""
    n = len(mesh.vertices)
    return np.isin(edges @ [n, 1], Surface(mesh.vertices, mesh.boundary_faces()[0]).edges() @ [n, 1])
