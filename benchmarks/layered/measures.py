"""What is measured on a simulated frame from its vertices alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import igl
import numpy as np

from benchmarks.layered import balance
from benchmarks.trust.frames import volume_ratios
from handpipe.core import Array, BoolArray, Frame, IntArray, Layer, Shape, Shapes
from handpipe.mesh.surfaces import Surface
from handpipe.tissues.fat.layer import TissueLayer
from handpipe.tissues.muscles import MuscleLayer


@dataclass(frozen=True)
class Measured:
    """Of one or more frames the worst. Lengths are in mm; None where the layers have no such body.

    inverted: tets with det F of zero or less, of all bodies; least_det; bones_outside: largest distance of a
    bone's vertex from the skin, outside; twice: fat tets inside the skin twice, which lies in itself;
    fat_in_bodies: largest depth of the fat's inner points in the bodies below; muscles_in_bones: of free
    surface vertices; unbalanced: largest force left over the forces on its vertex; judged: smallest share of
    vertices in that; unsettled: frames that say that contact has not settled.
    """

    inverted: int = 0
    least_det: float = np.inf
    bones_outside: float | None = None
    twice: int = 0
    fat_in_bodies: float | None = None
    muscles_in_bones: float | None = None
    unbalanced: float | None = None
    judged: float | None = None
    unsettled: int = 0

    def worse(self, other: Measured) -> Measured:
        """The worst of both."""
        return Measured(
            self.inverted + other.inverted,
            min(self.least_det, other.least_det),
            _larger(self.bones_outside, other.bones_outside),
            max(self.twice, other.twice),
            _larger(self.fat_in_bodies, other.fat_in_bodies),
            _larger(self.muscles_in_bones, other.muscles_in_bones),
            _larger(self.unbalanced, other.unbalanced),
            _larger(self.judged, other.judged, min),
            self.unsettled + other.unsettled,
        )


def measured(frame: Frame, layers: Sequence[Layer], shapes: Mapping[str, Shapes]) -> Measured:
    """Measures of one frame; layers: those it was simulated with."""
    bodies = [shape for layer in shapes.values() for shape in layer.values()]
    ratios = [volume_ratios(s.rest, s.vertices, s.cells) for s in bodies if s.cells.shape[1] == 4]
    least = min((float(r.min()) for r in ratios), default=np.inf)
    inverted = sum(int((~(r > 0)).sum()) for r in ratios)
    unsettled = any(shape.figures.get("unsettled", 0.0) for shape in bodies)
    found = Measured(inverted, least, unsettled=int(unsettled))
    for layer in layers:
        found = found.worse(_of_layer(layer, frame, shapes))
    return found


def _of_layer(layer: Layer, frame: Frame, shapes: Mapping[str, Shapes]) -> Measured:
    if isinstance(layer, TissueLayer):
        force = balance.of_tissue(layer, frame, shapes)
        skin, mesh = shapes[layer.name]["skin"], shapes[layer.name][layer.name + "_mesh"]
        return Measured(
            bones_outside=bones_outside(shapes["bones"], skin),
            twice=tets_twice(skin, mesh),
            fat_in_bodies=fat_in_bodies(layer, shapes, mesh.vertices),
            unbalanced=force.largest,
            judged=force.judged,
        )
    if isinstance(layer, MuscleLayer):
        force = balance.of_muscles(layer, frame, shapes)
        depth = muscles_in_bones(layer, shapes)
        return Measured(muscles_in_bones=depth, unbalanced=force.largest, judged=force.judged)
    return Measured()


def _larger(a: float | None, b: float | None, choose=max) -> float | None:  # type: ignore[no-untyped-def]
    known = [value for value in (a, b) if value is not None]
    return choose(known) if known else None


def bones_outside(bones: Shapes, skin: Shape) -> float:
    """Distance outside the skin of the farthest bone vertex that is inside it in neutral."""
    farthest = 0.0
    for bone in bones.values():
        hidden = inside(bone.rest, Surface(skin.rest, skin.cells))
        points = bone.vertices[hidden]
        out = points[~inside(points, Surface(skin.vertices, skin.cells))]
        farthest = max(farthest, float(distances(out, skin.vertices, skin.cells).max(initial=0.0)))
    return farthest


def tets_twice(skin: Shape, mesh: Shape) -> int:
    """Number of tets whose middle the skin winds around more than once."""
    middles = np.ascontiguousarray(mesh.vertices[mesh.cells].mean(axis=1))
    winding = np.asarray(igl.fast_winding_number(skin.vertices, skin.cells, middles))
    return int((winding > 1.5).sum())


def fat_in_bodies(layer: TissueLayer, shapes: Mapping[str, Shapes], x: Array) -> float:
    """Largest depth of the tissue's inner points in their bodies."""
    inner, points = layer.tissue.inner, layer.tissue.inner_matrix @ x
    surfaces = inner.surfaces(shapes)
    return max((depth(points[inner.body == i], s) for i, s in enumerate(surfaces)), default=0.0)


def muscles_in_bones(layer: MuscleLayer, shapes: Mapping[str, Shapes]) -> float:
    """Largest depth in a bone of a muscle's surface vertex that is not attached."""
    bones = [Surface(s.vertices, s.cells) for s in shapes["bones"].values()]
    free = [np.delete(shapes[layer.name][m.name].vertices, m.firm, axis=0) for m in layer.muscles]
    return max(depth(points, bone) for points in free for bone in bones)


def depth(points: Array, surface: Surface) -> float:
    """Largest depth of points (k, 3) inside a closed surface."""
    within = points[inside(points, surface)]
    return float(distances(within, surface.vertices, surface.triangles).max(initial=0.0))


def inside(points: Array, surface: Surface) -> BoolArray:
    """Which points (k,) a closed surface winds around."""
    if len(points) == 0:
        return np.zeros(0, dtype=np.bool_)
    queries = np.ascontiguousarray(points, dtype=np.float64)
    winding = igl.fast_winding_number(surface.vertices, surface.triangles, queries)
    return np.asarray(winding).ravel() > 0.5


def distances(points: Array, vertices: Array, triangles: IntArray) -> Array:
    """Unsigned distances (k,) of points from a surface."""
    if len(points) == 0:
        return np.zeros(0)
    queries = np.ascontiguousarray(points, dtype=np.float64)
    return np.sqrt(np.ravel(igl.point_mesh_squared_distance(queries, vertices, triangles)[0]))


def change(a: Mapping[str, Shapes], b: Mapping[str, Shapes], layer: str = "", body: str = "skin") -> Array:
    """Distances (k,) between the vertices of one body in two frames, by default of their skins."""
    first, second = (_body(shapes, layer, body).vertices for shapes in (a, b))
    return np.linalg.norm(first - second, axis=1)


def skin_of(shapes: Mapping[str, Shapes]) -> Shape | None:
    """The skin of a frame, whichever layer it is of."""
    return next((layer["skin"] for layer in shapes.values() if "skin" in layer), None)


def _body(shapes: Mapping[str, Shapes], layer: str, body: str) -> Shape:
    if layer:
        return shapes[layer][body]
    return next(bodies[body] for bodies in shapes.values() if body in bodies)
