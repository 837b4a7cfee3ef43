"""What became of each organ's volume on the way from its source's surfaces to the mesh, counted on a grid."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from handpipe.anatomy.templates.solids import OrganSolid, depth
from handpipe.anatomy.templates.tissue_mesh import TissueMesh
from handpipe.core import IntArray
from handpipe.mesh.generation import Grid
from handpipe.mesh.surfaces import Surface, directed_edges

SPACING = 0.5  # mm


@dataclass(frozen=True)
class Account:
    """Volumes of one organ in its source and in the mesh, and defects of its source's surfaces.

    Parameters
    ----------
    source : float
        Volume in mm^3 of the source.
    in_bones : float
        Volume in mm^3 of the source that lies in bones.
    in_organs : float
        Volume in mm^3 of the source, outside of bones, that lies deeper in another organ.
    mesh : float
        Volume in mm^3 in the mesh.
    open_edges : int
        Edges of the source's surfaces with one triangle, where holes were closed across.
    branching_edges : int
        Edges with more than two triangles, where a surface touches itself.
    """

    source: float
    in_bones: float
    in_organs: float
    mesh: float
    open_edges: int
    branching_edges: int

    def lost(self) -> float:
        """Volume in mm^3 that neither bones nor organs have: thin ends, and what smoothing took."""
        return self.source - self.in_bones - self.in_organs - self.mesh

    def rows(self, organ: str) -> list[dict[str, str | float]]:
        """A row a figure, as tables have them."""
        figures = {**asdict(self), "lost": self.lost()}
        units = {name: "1" if name.endswith("_edges") else "mm^3" for name in figures}
        return [{"organ": organ, "what": n, "value": v, "unit": units[n]} for n, v in figures.items()]


def accounts(
    solids: Mapping[str, OrganSolid], bones: Mapping[str, Surface], template: TissueMesh
) -> dict[str, Account]:
    """Account of the volume of each organ of a template.

    Parameters
    ----------
    solids : mapping of str to OrganSolid
        Organs of the source by name.
    bones : mapping of str to Surface
        Surfaces in mm by bone.
    template : TissueMesh
        The template made of them.

    Returns
    -------
    mapping of str to Account
        Volumes in mm^3 by organ.
    """
    meshed = dict(zip(template.names, template.volumes(), strict=True))
    return {name: _account(name, solids, bones, float(meshed[name])) for name in solids}


def _account(
    name: str, solids: Mapping[str, OrganSolid], bones: Mapping[str, Surface], meshed: float
) -> Account:
    solid = solids[name]
    corners = np.concatenate([surface.vertices for surface in solid.surfaces])
    points = Grid.around(corners, SPACING, SPACING).points() + SPACING / np.array([2, 3, 5])  # on no symmetry
    own = depth(solid.surfaces, points)
    points, own = points[own > 0], own[own > 0]
    in_bones = depth(list(bones.values()), points) > 0
    others = [depth(other.surfaces, points) for label, other in solids.items() if label != name]
    in_organs = ~in_bones & (np.max(others, axis=0) > own) if others else np.zeros(len(points), dtype=bool)
    cell = SPACING**3
    volumes = (cell * len(points), cell * int(in_bones.sum()), cell * int(in_organs.sum()), meshed)
    counts = np.concatenate([_triangles_at_edges(surface) for surface in solid.surfaces])
    return Account(*volumes, int((counts == 1).sum()), int((counts > 2).sum()))


def _triangles_at_edges(surface: Surface) -> IntArray:
    """The number (e,) of triangles at each edge."""
    edges = np.sort(directed_edges(surface.triangles), axis=1)
    return np.asarray(np.unique(edges, axis=0, return_counts=True)[1], dtype=np.int64)
