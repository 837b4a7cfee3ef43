"""The bodies of the finger whose tissues slide: fat within the skin, both muscles, four bones.

Fat is one body around one cavity. In the cavity lie bones and muscles, and no tissue grows on another but
where it is attached. Shapes are the phantom finger's; its muscles are thinner by half a gap, and thicker at
their ends.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import Array, BoolArray, IntArray
from handpipe.mesh.generation import Grid, isosurface, remesh, smooth_minimum, tetrahedralise
from handpipe.mesh.generation.implicit import signed_distance
from handpipe.mesh.surfaces import Surface, concatenate
from handpipe.mesh.tets import TetMesh
from handpipe.synthetic.coupled.coupled_body import CoupledAnatomy
from handpipe.synthetic.phantom.phantom_finger import finger
from handpipe.synthetic.phantom.phantom_muscles import INSERTION, ORIGIN, KnownMuscle, contact_height
from handpipe.synthetic.phantom.phantom_skin import START, nail_share

GAP = 0.3  # mm between bodies at rest, at least
ROOM = 0.7  # mm between the cavity's wall and what lies in it: its facets cut the corner of what is round
SPACING = 0.5  # mm of the grid on which shapes are computed
BAND = 4.0  # mm around a shape within which its distance is exact
ROUNDING = 4.0  # mm: parts of the cavity's content nearer than this to one another run into one
SINEWS = (1.9, 2.4)  # mm, width and height of muscles' ends: one for both muscles
FAT = 1.2  # mm of fat that the skin has more than the phantom's, whose muscles' ends lie just beneath it
EDGES = {"skin": 4.2, "cavity": 2.6, "muscle": 2.2, "bone": 2.4}  # mm, lengths of triangles' edges
SIDES = 14  # of a muscle's sections
ENDS = 3.0  # mm of a muscle's ends that are attached to bone
# The cavity's wall is attached to bones from x to x in mm, below a height z in mm (Cleland's and Grayson's
# ligaments and the pulleys hold the palmar side, the dorsal side glides); at its ends all around.
SEPTA = {
    "metacarpal2": ((START, 5.0, np.inf), (26.0, 34.0, -3.0)),
    "proximal2": ((84.0, 92.0, -2.0),),
    "middle2": ((114.0, 120.0, -1.5),),
    "distal2": ((135.0, 160.0, np.inf),),
}
NAIL = 0.3  # least `nail_share` of a vertex of the skin that moves with the distal bone, as the nail does
CUT = START + 2.0  # mm, x of the end that is cut off the hand, attached to the metacarpal


@dataclass(frozen=True, eq=False)
class FingerBodies:
    """Bodies at rest: the anatomy of fat and muscles, whose `bones` have the attached vertices; bones.

    The mesh's parts share no vertices.
    """

    anatomy: CoupledAnatomy
    bones: Mapping[str, Surface]


def muscles() -> dict[str, KnownMuscle]:
    """The phantom finger's muscles with thicker ends."""
    return {name: replace(muscle, tendon=SINEWS) for name, muscle in finger().muscles.items()}


def build(edges: Mapping[str, float] = EDGES) -> FingerBodies:
    """The bodies with triangles of these edge lengths in mm."""
    anatomy = finger()
    phantom = Surface(*anatomy.skin_surface)
    skin = phantom.moved(phantom.vertices + FAT * phantom.vertex_normals())
    grid = Grid.around(skin.vertices, 4 * SPACING, SPACING)

    def distance(surface: Surface) -> Array:
        return signed_distance(surface, grid, BAND).reshape(grid.shape)

    def surface(values: Array, level: float, edge: float) -> Surface:
        return remesh(isosurface(values, grid, level).largest_component(), edge)

    bones = {name: Surface(*s) for name, s in anatomy.bones.items()}
    known = muscles()
    shapes = {name: distance(Surface(*muscle.surface())) for name, muscle in known.items()}
    content = None
    for values in (
        *(distance(bone) for bone in bones.values()),
        *(shape + 0.5 * GAP for shape in shapes.values()),
    ):
        content = values if content is None else smooth_minimum(content, values, ROUNDING)
    assert content is not None
    outer = remesh(skin, edges["skin"])
    cavity = surface(content, ROOM, edges["cavity"])
    fat = tetrahedralise(concatenate([outer, cavity.flipped()]), edges["skin"])
    parts = [fat, *(_belly(muscle, edges["muscle"]) for muscle in known.values())]
    starts = np.cumsum([0, *(len(p.vertices) for p in parts)])
    mesh = TetMesh(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.tets + s for p, s in zip(parts, starts[:-1], strict=True)]),
    )
    labels = np.repeat(np.arange(len(parts)), [len(p.tets) for p in parts])
    on_skin = np.arange(len(mesh.vertices)) < len(outer.vertices)
    in_cavity = ~on_skin & (np.arange(len(mesh.vertices)) < len(outer.vertices) + len(cavity.vertices))
    in_muscle = np.arange(len(mesh.vertices)) >= starts[1]
    attached = _attached(mesh.vertices, on_skin, in_cavity, in_muscle)
    fibres = {name: _fibres(muscle, parts[number + 1]) for number, (name, muscle) in enumerate(known.items())}
    return with_bones(CoupledAnatomy(mesh, labels, ("fat", *known), attached, fibres), edges)


def with_bones(anatomy: CoupledAnatomy, edges: Mapping[str, float] = EDGES) -> FingerBodies:
    """The bodies of an anatomy that `build` made, with the phantom finger's bones."""
    bones = {name: remesh(Surface(*s), edges["bone"]) for name, s in finger().bones.items()}
    return FingerBodies(anatomy, bones)


def _belly(muscle: KnownMuscle, edge: float) -> TetMesh:
    """A muscle within half a gap of the known one: wedges about its middle line between rings of vertices.

    Edges run along the muscle: facets do not catch on others when it slides.
    """
    rings = int((INSERTION - ORIGIN) / edge)
    known = Surface(*muscle.surface(rings, SIDES))
    thinner = known.vertices - 0.5 * GAP * known.vertex_normals()
    around = thinner[1:-1].reshape(rings, SIDES, 3)
    points = np.concatenate([around.mean(axis=1, keepdims=True), around], axis=1)
    ring, side = np.meshgrid(np.arange(rings - 1), np.arange(SIDES), indexing="ij")
    columns = np.sort(np.stack([np.zeros_like(side), 1 + side, 1 + (side + 1) % SIDES], axis=-1), axis=-1)
    low = (ring[..., None] * (SIDES + 1) + columns).reshape(-1, 3)
    # Sorted columns: the diagonals of neighbouring wedges meet.
    wedges = np.concatenate([low, low + SIDES + 1], axis=1)
    tets = wedges[:, [[0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5]]].reshape(-1, 4)
    turned = TetMesh(points.reshape(-1, 3), tets).volumes() < 0
    tets[turned] = tets[turned][:, [0, 1, 3, 2]]
    return TetMesh(points.reshape(-1, 3), tets).checked("belly")


def _attached(
    x: Array, on_skin: BoolArray, in_cavity: BoolArray, in_muscle: BoolArray
) -> dict[str, IntArray]:
    """Vertices that move with each bone, of vertices x (n, 3); muscles with two."""
    along, _, height = x.T
    found = {}
    for bone, bands in SEPTA.items():
        moved = np.zeros(len(x), dtype=bool)
        for start, end, below in bands:
            moved |= in_cavity & (along >= start) & (along <= end) & (height <= below)
        if bone == "metacarpal2":
            moved |= on_skin & (along < CUT)
            moved |= in_muscle & (along < ORIGIN + ENDS)
        if bone == "distal2":
            moved |= on_skin & (nail_share(x) > NAIL)
        if bone == "proximal2":
            moved |= in_muscle & (along > INSERTION - ENDS)
        found[bone] = np.flatnonzero(moved)
    return found


def _fibres(muscle: KnownMuscle, mesh: TetMesh) -> Array:
    """Directions (m, 3) along the muscle's middle line."""
    x = mesh.vertices[mesh.tets].mean(axis=1)[:, 0]
    step = 0.5

    def middle(at: Array) -> Array:
        bell = muscle.bell(at)
        width, height = (
            thin + (thick - thin) * bell for thin, thick in zip(muscle.tendon, muscle.belly, strict=True)
        )
        return np.column_stack(
            [at, muscle.beside(at) + 0.5 * width, contact_height(at) + 0.5 * muscle.side * height]
        )

    inside = np.clip(x, ORIGIN + step, INSERTION - step)
    along = middle(inside + step) - middle(inside - step)
    return along / np.linalg.norm(along, axis=1, keepdims=True)
