"""How the bodies below constrain the tissue: fixed, sliding and contact points (Zheng 2022 §7.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from handpipe.core import Array, BoolArray, InputError, IntArray, Region, Shape, Shapes
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import mass_lumped

OPENING = 0.3  # of the largest opening's area, from which another one is a cut and no hole
WALL = 0.9  # of a valley's width: a point that far out which is nearer has another wall beside it


@dataclass(frozen=True)
class InnerPoints:
    """Points of inner bodies that touch the tissue.

    Parameters
    ----------
    layers, bodies : tuple of str
        Names of each body's layer, and of the body.
    body : array (k,)
        Index of each point's body.
    vertex : array (k,)
        Vertex of that body.
    rest : array (k, 3)
        Neutral positions in mm.
    normal : array (k, 3)
        Unit normals of the neutral body there, outwards.
    region : array (k,)
        Values of `Region`.
    area : array (k,)
        Area in mm^2 that belongs to each point.
    """

    layers: tuple[str, ...]
    bodies: tuple[str, ...]
    body: IntArray
    vertex: IntArray
    rest: Array
    normal: Array
    region: IntArray
    area: Array

    def chosen(self, keep: BoolArray) -> InnerPoints:
        """Some of the points, by a mask (k,)."""
        columns = ("body", "vertex", "rest", "normal", "region", "area")
        return replace(self, **{name: getattr(self, name)[keep] for name in columns})

    def posed(self, below: Mapping[str, Shapes]) -> Array:
        """Positions (k, 3) of the points on the bodies as posed."""
        points = np.empty_like(self.rest)
        for index, surface in enumerate(self.surfaces(below)):
            mine = self.body == index
            points[mine] = surface.vertices[self.vertex[mine]]
        return points

    def shape(self, below: Mapping[str, Shapes], index: int) -> Shape:
        """The posed body of an index; `InputError` if it is not below."""
        layer, body = self.layers[index], self.bodies[index]
        if body not in below.get(layer, {}):
            problem = f"{body} is missing, but the tissue was built on it"
            raise InputError("layers", layer, problem, "Simulate it, or build the tissue without it")
        return below[layer][body]

    def surfaces(self, below: Mapping[str, Shapes]) -> list[Surface]:
        """The posed bodies, in the order of `bodies`; `InputError` for one that is not below."""
        shapes = [self.shape(below, index) for index in range(len(self.bodies))]
        return [Surface(s.vertices, s.cells) for s in shapes]

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return {**vars(self), "layers": list(self.layers), "bodies": list(self.bodies)}

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> InnerPoints:
        """What `to_group` gave, as an artifact returned it."""
        return InnerPoints(**{**group, "layers": tuple(group["layers"]), "bodies": tuple(group["bodies"])})


def default_region(layer: str) -> Region:
    """The default where a body has no field "region": fixed on bones, in contact on all else, tendons too."""
    return Region.fixed if layer == "bones" else Region.contact


def inner_points(
    below: Mapping[str, Shapes], layers: tuple[str, ...], inner: Surface, slack: float, valley: float = 1.5
) -> InnerPoints:
    """The vertices of neutral bodies that touch the tissue.

    In valleys of the inner surface sliding gives way to contact.

    Parameters
    ----------
    below : mapping of str to Shapes
        Neutral shapes by layer. Only bodies of triangles count. A body's field "region" (n,) says how its
        vertices constrain the tissue; without it, bones are fixed and all else is in contact.
    layers : tuple of str
        Layers whose bodies count, if `below` has them.
    inner : Surface
        Inner surface of the tissue in mm.
    slack : float
        Depth in mm beneath the inner surface up to which vertices count.
    valley : float
        Radius in mm of a ball that does not fit above a vertex in a valley.

    Returns
    -------
    InnerPoints
        The vertices, in the order of the bodies.

    References
    ----------
    Zheng 2022 §7.1.
    """
    named = [(layer, name, shape) for layer in layers for name, shape in below.get(layer, {}).items()]
    named = [(layer, name, shape) for layer, name, shape in named if shape.cells.shape[1] == 3]
    distance = Distance(inner)
    parts = []
    for index, (layer, _, shape) in enumerate(named):
        surface = Surface(shape.vertices, shape.cells)
        area, normal = mass_lumped(surface.vertices, surface.triangles), surface.vertex_normals()
        region = shape.fields.get("region", np.full(len(shape.vertices), default_region(layer)))
        vertex = np.flatnonzero(distance.signed(shape.vertices)[0] > -slack)
        on = (surface.vertices[vertex], normal[vertex], region[vertex], area[vertex])
        parts.append((np.full(len(vertex), index), vertex, *on))
    columns = (np.concatenate(p) for p in zip(*parts, strict=True))
    points = InnerPoints(tuple(n[0] for n in named), tuple(n[1] for n in named), *columns)
    in_valley = distance.signed(points.rest + valley * points.normal)[0] < WALL * valley
    changed = in_valley & (points.region == Region.sliding)
    return replace(points, region=np.where(changed, Region.contact, points.region).astype(np.int64))


def cut_ends(skin: Surface, scan: Surface, tolerance: float) -> list[IntArray]:
    """Skin vertices that the scan does not cover at its large openings: where the limb was cut off.

    A leg may be cut at both ends, and by the image's side.

    Parameters
    ----------
    skin : Surface
        Closed skin in mm.
    scan : Surface
        Scan in mm, with openings.
    tolerance : float
        Distance in mm to the scan from which a vertex counts as uncovered.

    Returns
    -------
    list of array (k,) of int
        Ids of the connected groups of uncovered vertices, the largest first, that have at least 0.3 of its
        area; none where the scan covers all.
    """
    uncovered = Distance(scan).closest(skin.vertices)[0] > tolerance
    if not uncovered.any():
        return []
    edges, n = skin.edges(), len(uncovered)
    first, second = edges[uncovered[edges].all(axis=1)].T
    graph = sparse.coo_matrix((np.ones(len(first)), (first, second)), shape=(n, n))
    group = connected_components(graph, directed=False)[1]
    areas = np.bincount(group, mass_lumped(skin.vertices, skin.triangles) * uncovered)
    large = [number for number in np.argsort(-areas) if areas[number] >= OPENING * areas.max()]
    return [np.flatnonzero(group == number) for number in large]
