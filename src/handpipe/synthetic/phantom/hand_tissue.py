"""What surrounds a generated hand's bones in its images: round cones between points that bones carry.

It is a background for segmentation, not anatomy with a truth: tendons and ligaments as dark as cortical bone
and touching it, grey muscle and cartilage, fat up to the skin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from handpipe.core import Array, RigidTransform
from handpipe.mesh.generation import implicit
from handpipe.synthetic.acquisition.image import VoxelGrid
from handpipe.synthetic.phantom.phantom_bones import Point

Bones = Mapping[str, RigidTransform]
Place = tuple[str, Point]
"""A point in a bone's own frame."""

SKIN_BLEND = 5.0  # mm over which cones run into one another
TENDON, LIGAMENT = 1.5, 1.1  # mm, radii


@dataclass(frozen=True)
class Cone:
    """A round cone from one bone's point to another's, or the same bone's; radii in mm."""

    start: Place
    end: Place
    radius_start: float
    radius_end: float


@dataclass(frozen=True)
class Strand:
    """A smooth cord through points of bones, of one radius in mm."""

    places: tuple[Place, ...]
    radius: float


@dataclass(frozen=True)
class Layout:
    """The bones of a hand as the tissues need them.

    frames: where each bone's own frame lies in the neutral hand, a long bone's with its origin at its near
    end and +x along it, a carpal's with its origin in its middle, +z dorsal; chains: by ray (1 is the thumb)
    the long bones outwards, each with its name, its length in mm and its girth as a share of the phantom
    finger's; stretch: length of a long bone as a share of the median hand's, where it is another one; flesh:
    radius of the skin as a share of the median hand's.
    """

    frames: Bones
    chains: Mapping[int, tuple[tuple[str, float, float], ...]]
    stretch: Mapping[str, float] = field(default_factory=dict)
    flesh: float = 1.0

    def fleshed(self, cones: Sequence[Cone]) -> list[Cone]:
        """Cones of this hand's skin, for those that the median hand's flesh gives these bones.

        The flesh was measured at the knuckles. Fingers beyond their first phalanges keep the median hand's:
        with less, too little is left beside the joints.
        """

        def grown(cone: Cone) -> Cone:
            grow = 1.0 if cone.start[0].startswith(("middle", "distal")) else self.flesh
            return replace(cone, radius_start=grow * cone.radius_start, radius_end=grow * cone.radius_end)

        return [*map(grown, cones)]

    def stretched(self, cones: Sequence[Cone]) -> list[Cone]:
        """Cones between places of this hand's bones, for cones between places of the median hand's."""

        def place(at: Place) -> Place:
            bone, (x, y, z) = at
            return bone, (self.stretch.get(bone, 1.0) * x, y, z)

        return [replace(c, start=place(c.start), end=place(c.end)) for c in cones]


@dataclass(frozen=True)
class Tissues:
    """What surrounds the bones in one pose: round cones (n, 8), both ends and both radii in mm."""

    skin: Array
    muscle: Array
    cartilage: Array
    ligament: Array
    tendon: Array


@dataclass(frozen=True)
class Surroundings:
    """The same in the frames of the bones that carry them."""

    frames: Bones
    skin: Sequence[Cone]
    muscle: Sequence[Cone]
    cartilage: Sequence[Cone]
    ligaments: Sequence[Strand]
    tendons: Sequence[Strand]

    @staticmethod
    def build(layout: Layout) -> Surroundings:
        """The tissues of a hand whose bones lie so."""
        parts = (skin(layout), muscle(), cartilage(layout), ligaments(layout), tendons(layout))
        return Surroundings(layout.frames, *parts)

    def scaled(self, size: float) -> Surroundings:
        """The same of a hand of the same shape that is `size` times as large."""

        def places(given: Sequence[Place]) -> tuple[Place, ...]:
            return tuple((bone, (size * x, size * y, size * z)) for bone, (x, y, z) in given)

        def cone(given: Cone) -> Cone:
            start, end = places((given.start, given.end))
            return Cone(start, end, size * given.radius_start, size * given.radius_end)

        def cones(given: Sequence[Cone]) -> list[Cone]:
            return [cone(c) for c in given]

        def strands(given: Sequence[Strand]) -> list[Strand]:
            return [Strand(places(s.places), size * s.radius) for s in given]

        frames = {n: RigidTransform(f.rotation, size * f.translation) for n, f in self.frames.items()}
        return Surroundings(
            frames,
            cones(self.skin),
            cones(self.muscle),
            cones(self.cartilage),
            strands(self.ligaments),
            strands(self.tendons),
        )

    def posed(self, transforms: Bones) -> Tissues:
        """The tissues where the bones' transforms from neutral carry them."""
        placed = {name: transforms[name] @ frame for name, frame in self.frames.items()}
        return Tissues(
            cone_rows(self.skin, placed),
            cone_rows(self.muscle, placed),
            cone_rows(self.cartilage, placed),
            strand_rows(self.ligaments, placed),
            strand_rows(self.tendons, placed),
        )


def posed_points(places: Sequence[Place], placed: Bones) -> Array:
    """Points (n, 3) of bones, whose own frames are placed in a pose."""
    return np.array([placed[bone](np.array(point)) for bone, point in places])


def cone_rows(cones: Sequence[Cone], placed: Bones) -> Array:
    """Cones in a pose (n, 8): both ends, both radii."""
    ends = posed_points([p for c in cones for p in (c.start, c.end)], placed).reshape(-1, 6)
    return np.hstack([ends, [[c.radius_start, c.radius_end] for c in cones]])


def strand_rows(strands: Sequence[Strand], placed: Bones) -> Array:
    """Strands in a pose as short cones (n, 8), a millimetre and a half each."""
    rows = []
    for strand in strands:
        knots = posed_points(strand.places, placed)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
        line = CubicSpline(along, knots)(np.linspace(0.0, along[-1], int(along[-1] / 1.5) + 2))
        rows.append(np.hstack([line[:-1], line[1:], np.full((len(line) - 1, 2), strand.radius)]))
    return np.vstack(rows)


@njit(cache=True)
def _blend(field: NDArray[np.float32], origin: Array, spacing: float, cones: Array, blend: float) -> None:
    """Smooth minimum of a field on a grid with the distances to round cones, each in a box around it."""
    for r in range(len(cones)):
        a, b, first, last = cones[r, :3], cones[r, 3:6], cones[r, 6], cones[r, 7]
        reach = max(first, last) + blend + 2.0 * spacing
        low = np.empty(3, dtype=np.int64)
        high = np.empty(3, dtype=np.int64)
        for d in range(3):
            low[d] = max(0, int(np.floor((min(a[d], b[d]) - reach - origin[d]) / spacing)))
            high[d] = min(field.shape[d] - 1, int(np.ceil((max(a[d], b[d]) + reach - origin[d]) / spacing)))
        e0, e1, e2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        length = max(e0 * e0 + e1 * e1 + e2 * e2, 1e-12)
        for i in range(low[0], high[0] + 1):
            x = origin[0] + spacing * i - a[0]
            for j in range(low[1], high[1] + 1):
                y = origin[1] + spacing * j - a[1]
                for k in range(low[2], high[2] + 1):
                    z = origin[2] + spacing * k - a[2]
                    t = min(1.0, max(0.0, (x * e0 + y * e1 + z * e2) / length))
                    u, v, w = x - t * e0, y - t * e1, z - t * e2
                    value = np.sqrt(u * u + v * v + w * w) - first - t * (last - first)
                    old = field[i, j, k]
                    h = max(blend - abs(old - value), 0.0) / blend if blend > 0.0 else 0.0
                    field[i, j, k] = min(old, value) - 0.25 * blend * h * h


def field_of_cones(rows: Array, grid: VoxelGrid | implicit.Grid, blend: float = 0.0) -> NDArray[np.float32]:
    """Distance in mm from the union of round cones (n, 8) near its surface, negative inside, on a grid."""
    field = np.full(grid.shape, 1e3, dtype=np.float32)
    _blend(field, grid.origin, grid.spacing, rows, blend)
    return field


def share_of_cones(rows: Array, grid: VoxelGrid, blend: float = 0.0) -> NDArray[np.float32]:
    """Share in [0, 1] of each voxel inside the union of round cones (n, 8), rounded over `blend` mm."""
    field = field_of_cones(rows, grid, blend)
    field *= np.float32(-1.0 / grid.spacing)
    field += np.float32(0.5)
    return np.clip(field, 0.0, 1.0, out=field)


def skin(layout: Layout) -> list[Cone]:
    """The hand's outline: a cone around each bone, more of them in the palm and at the wrist."""
    cones = []
    for chain in layout.chains.values():
        for name, length, girth in chain:
            palm = name.startswith("metacarpal")
            start, end = (10.5, 9.5) if palm else ((9.0, 8.0) if name.startswith("proximal") else (7.6, 6.6))
            low = -4.0 if palm else (-2.0 if name.startswith("distal") else -1.2)
            cones.append(
                Cone((name, (0, 0, low)), (name, (length, 0, low)), start * girth**0.5, end * girth**0.5)
            )
    between = [
        Cone(("trapezium", (0, 0, -3)), ("metacarpal1", (30, 2, -6)), 13.0, 10.0),
        Cone(("hamate", (0, 0, -4)), ("metacarpal5", (45, -1, -6)), 13.0, 9.0),
        Cone(("capitate", (-70, 9, -4)), ("capitate", (0, 4, -4)), 19.0, 16.0),
        Cone(("capitate", (-70, -9, -4)), ("capitate", (0, -6, -4)), 19.0, 16.0),
        Cone(("metacarpal1", (34, -4, -4)), ("metacarpal2", (36, 2, -4)), 7.0, 8.0),
    ]
    return layout.fleshed([*cones, *layout.stretched(between)])


def muscle() -> list[Cone]:
    """Grey bellies: interossei, thenar and hypothenar, flexors of the forearm."""
    cones = [
        Cone((f"metacarpal{a}", (14, -5.5, -1)), (f"metacarpal{a}", (44, -7.5, -1)), 2.6, 3.2)
        for a in (2, 3, 4)
    ]
    cones += [
        Cone((f"metacarpal{a}", (16, 5.0, -5)), (f"metacarpal{a}", (46, 5.5, -6)), 2.8, 2.2)
        for a in (3, 4, 5)
    ]
    return cones + [
        Cone(("metacarpal1", (14, -6, 2)), ("metacarpal2", (40, 8.5, -1)), 4.0, 3.4),
        Cone(("metacarpal1", (38, -5, -3)), ("metacarpal3", (30, 2, -9)), 4.0, 4.5),
        Cone(("trapezium", (2, 0, -9)), ("metacarpal1", (36, 2, -9)), 5.0, 4.2),
        Cone(("trapezium", (2, -9, -9)), ("metacarpal1", (40, -5, -8)), 4.4, 3.6),
        Cone(("hamate", (2, -4, -12)), ("metacarpal5", (44, -5, -6)), 5.0, 3.6),
        Cone(("hamate", (6, 3, -12)), ("metacarpal5", (40, 4, -8)), 4.0, 3.2),
        Cone(("capitate", (-70, 4, -8)), ("capitate", (-26, 3, -9)), 8.0, 5.0),
    ]


def cartilage(layout: Layout) -> list[Cone]:
    """Grey joints: a ball about the end of each bone that carries another, and between the carpals."""
    cones = []
    for ray, chain in layout.chains.items():
        for name, length, girth in chain[:-1]:
            radius = {"m": 6.4, "p": 5.4}[name[0]] * girth if not name.startswith("middle") else 4.2 * girth
            cones.append(Cone((name, (length - 0.5, 0, 0)), (name, (length + 0.5, 0, 0)), radius, radius))
        if ray > 1:
            cones.append(
                Cone((f"metacarpal{ray}", (-1.0, 0, 0)), (f"metacarpal{ray}", (0.5, 0, 0)), 6.5, 6.5)
            )
    cones.append(Cone(("metacarpal1", (-1.0, 0, 0)), ("metacarpal1", (0.5, 0, 0)), 6.5, 6.5))
    return [*cones, Cone(("trapezium", (0, -3, 0)), ("hamate", (0, 3, 0)), 5.5, 5.5)]


def tendons(layout: Layout) -> list[Strand]:
    """Flexors and extensors along each ray, against the bones they pass."""
    strands = []
    for ray, chain in layout.chains.items():
        palmar: list[Place] = [("capitate", (-45, 4 - 3 * ray, -13)), ("capitate", (0, 6 - 2.2 * ray, -14))]
        dorsal: list[Place] = [("capitate", (-45, 9 - 4 * ray, 9)), ("capitate", (0, 10 - 4 * ray, 9.6))]
        if ray == 1:
            palmar, dorsal = [("trapezium", (-4, -7, -9))], [("trapezium", (-6, 2, 8.5))]
        for name, length, girth in chain:
            kind = name[0]
            half = {"m": 4.7, "p": 4.2, "d": 2.6}[kind] if not name.startswith("middle") else 3.4
            off = girth * half + TENDON - 0.15
            at = (0.45, 0.8) if kind == "m" else (0.3, 0.75) if kind != "d" else (0.12, 0.35)
            palmar += [(name, (share * length, 0.0, -off - (2.0 if kind == "m" else 0.3))) for share in at]
            dorsal += [(name, (share * length, 0.0, off)) for share in at]
        strands += [Strand(tuple(palmar), TENDON), Strand(tuple(dorsal), 0.8 * TENDON)]
    return strands


def ligaments(layout: Layout) -> list[Strand]:
    """Collateral ligaments on both sides of the joints of the fingers and of the thumb's MP and IP."""
    strands = []
    for chain in layout.chains.values():
        for (inner, length, girth), (outer, _, outer_girth) in zip(chain[:-1], chain[1:], strict=True):
            width = {"m": 6.4, "p": 5.6}[inner[0]] if not inner.startswith("middle") else 4.4
            for side in (1.0, -1.0):
                y, z = side * girth * width, -0.8 * girth
                places = (
                    (inner, (length - 6.0 * girth, 0.9 * y, z + 1.5)),
                    (inner, (length - 2.0 * girth, y, z)),
                    (outer, (3.0 * outer_girth, side * outer_girth * width, z)),
                )
                strands.append(Strand(places, LIGAMENT))
    return strands
