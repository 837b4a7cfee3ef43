"""The phantom hand's bones in the neutral pose of a right hand: +x distal, +y radial, +z dorsal, mm.

Lengths are those of a median male hand (Buryanov and Kotiuk 2010). The long bones of each ray have the
shapes of the phantom finger's, resized; the distal carpals are rounded blocks. A bone that lies on another
is hollowed to fit it, so that heads nearly touch the bases that they carry.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.synthetic.acquisition.sampled import moved
from handpipe.synthetic.geometry.implicit import Implicit, carved, ellipsoid, rounded_box, smooth_union
from handpipe.synthetic.phantom.hand_build import HandBuild
from handpipe.synthetic.phantom.phantom_bones import (
    DISTAL,
    METACARPAL,
    MIDDLE,
    PROXIMAL,
    KnownBone,
    LongBone,
    Point,
    with_marrow,
)

Surface = tuple[Array, IntArray]

FINGERS = (2, 3, 4, 5)  # rays with three phalanges
ROOT = "metacarpal3"
WITH_ROOT = ("metacarpal2", "trapezium", "trapezoid", "capitate", "hamate")
GAP = 0.6  # mm of cartilage between bones that lie on one another
BASE_GAP = 0.9  # mm between the bases of metacarpals, which slide past one another
BASE_BLEND = 1.0  # mm over which a bone runs into what is added to its base
SEAT = 0.2  # mm from the end of a bone to the start of the next one before it is hollowed


@dataclass(frozen=True)
class Kind:
    """What bones of a kind share: their shape at girth 1, and how thick their cortex is.

    head: from the bone's end back to the middle of its head, and that middle's height, at girth 1; cortex:
    along the shaft and under the joints; beyond: what the median hand's surfaces, hollowed at their bases and
    rounded at their heads, are longer than stated. All in mm.
    """

    shape: LongBone
    head: tuple[float, float]
    cortex: tuple[float, float]
    beyond: float


KINDS = {
    "metacarpal": Kind(METACARPAL, (6.8, 0.0), (1.4, 0.75), -0.5),
    "proximal": Kind(PROXIMAL, (4.6, -0.6), (1.3, 0.7), 0.2),
    "middle": Kind(MIDDLE, (3.7, -0.3), (1.1, 0.65), 0.6),
    "distal": Kind(DISTAL, (2.9, 0.0), (0.85, 0.6), 0.5),
}


@dataclass(frozen=True)
class RaySegment:
    """A long bone of a ray: its length in mm and its girth as a share of the index finger's."""

    kind: Kind
    length: float
    girth: float

    def bone(self) -> LongBone:
        """Its shape along x."""
        return self.kind.shape.resized(self.length, self.girth)

    def head(self) -> Array:
        """Middle of the head (3,), about which the next bone turns, in the bone's own frame."""
        back, height = self.kind.head
        return np.array([self.length - self.girth * back, 0.0, self.girth * height])


def _ray(lengths: Sequence[float], girths: Sequence[float]) -> dict[str, RaySegment]:
    """The long bones of a ray outwards; three lengths are a thumb's, which has no middle phalanx."""
    kinds = [k for k in KINDS if len(lengths) == 4 or k != "middle"]
    return {k: RaySegment(KINDS[k], *size) for k, *size in zip(kinds, lengths, girths, strict=True)}


RAYS = {
    1: _ray((49, 32, 22), (1.05, 1.02, 1.3)),
    2: _ray((66, 40, 22, 16), (1.0, 1.0, 1.0, 1.0)),
    3: _ray((69, 44, 24, 17), (1.0, 1.04, 1.04, 1.05)),
    4: _ray((65, 41, 22, 16), (0.9, 0.96, 0.96, 1.0)),
    5: _ray((57, 31, 18, 14), (0.86, 0.84, 0.82, 0.86)),
}
# Where each metacarpal begins, where it points, and its dorsal side.
METACARPALS: dict[int, tuple[Point, Point, Point]] = {
    1: ((-2.5, 26.5, -9.0), (0.76, 0.58, -0.29), (0.0, 0.80, 0.60)),
    2: ((0.5, 13.6, -0.5), (1.0, 0.115, -0.01), (0.0, 0.12, 1.0)),
    3: ((0.0, 0.5, 0.5), (1.0, 0.015, 0.0), (0.0, 0.0, 1.0)),
    4: ((-1.5, -11.4, -0.3), (1.0, -0.10, -0.02), (0.0, -0.14, 1.0)),
    5: ((-3.5, -21.6, -2.5), (1.0, -0.20, -0.05), (0.0, -0.28, 1.0)),
}
# Flexion in degrees at each joint outwards of a hand at rest, which is the zero of all angles.
REST = {1: (10, 12), 2: (12, 14, 8), 3: (14, 16, 8), 4: (16, 18, 9), 5: (18, 18, 10)}


@dataclass(frozen=True)
class PlacedBone:
    """A bone in its own frame, +x along it, and where that frame lies in the neutral hand."""

    known: KnownBone
    frame: RigidTransform

    def placed(self) -> Implicit:
        """The whole bone in the neutral frame."""
        return moved(self.known.whole, self.frame)

    def surface(self, shape: Implicit, spacing: float) -> Surface:
        """Closed surface of one of the bone's shapes in the neutral frame."""
        vertices, triangles = self.known.surface(shape, spacing)
        return self.frame(vertices), triangles


def frame_of(origin: Point | Array, direction: Point | Array, dorsal: Point | Array) -> RigidTransform:
    """The frame at an origin with +x along a direction and +z nearest to the dorsal side."""
    x = np.asarray(direction, float) / np.linalg.norm(direction)
    z = np.asarray(dorsal, float) - np.dot(dorsal, x) * x
    z /= np.linalg.norm(z)
    return RigidTransform(np.stack([x, np.cross(z, x), z], axis=1), np.asarray(origin, float))


def rays(build: HandBuild | None = None) -> dict[int, dict[str, RaySegment]]:
    """The long bones of each ray outwards: of the median hand, or of another one before it has its size."""
    if build is None:
        return RAYS

    def grown(kind: str, ray: int, segment: RaySegment) -> RaySegment:
        bone = f"{kind}{ray}"
        length = build.length(bone) - segment.kind.beyond
        return RaySegment(segment.kind, length, segment.girth * build.girth(bone))

    return {ray: {k: grown(k, ray, s) for k, s in segments.items()} for ray, segments in RAYS.items()}


def stretch(build: HandBuild) -> dict[str, float]:
    """Length of each long bone as a share of the median hand's, before the hand has its size."""
    grown = rays(build)
    return {
        f"{kind}{ray}": grown[ray][kind].length / segment.length
        for ray, segments in RAYS.items()
        for kind, segment in segments.items()
    }


def frames(build: HandBuild | None = None) -> dict[str, RigidTransform]:
    """Where each bone's own frame lies in the neutral hand."""
    found = {name: frame for name, (_, frame) in _carpal_blocks().items()}
    for ray, segments in rays(build).items():
        names = list(segments)
        found[f"{names[0]}{ray}"] = frame_of(*METACARPALS[ray])
        for inner, outer, bend in zip(names[:-1], names[1:], REST[ray], strict=True):
            turn = Rotation.from_rotvec([0.0, np.radians(bend), 0.0]).as_matrix()
            step = RigidTransform(np.eye(3), np.array([segments[inner].length + SEAT, 0.0, 0.0]))
            hinge = RigidTransform.about(segments[inner].head(), turn)
            found[f"{outer}{ray}"] = found[f"{inner}{ray}"] @ hinge @ step
    return found


def saddle_centre() -> Array:
    """Middle (3,) of the trapezium's round facet, which carries the thumb."""
    origin, direction, _ = METACARPALS[1]
    return np.array(origin) - 6.8 * np.array(direction) / np.linalg.norm(direction)


def facet_centre(ray: int) -> Array:
    """Middle (3,) of the hamate's round facet, which carries metacarpal IV or V."""
    origin, direction, _ = METACARPALS[ray]
    return np.array(origin) - (6.4 if ray == 4 else 5.9) * np.array(direction) / np.linalg.norm(direction)


def _carpal_blocks() -> dict[str, tuple[Implicit, RigidTransform]]:
    """The distal carpals in frames of their own, whose origins are their middles."""
    dorsal = (0.0, 0.0, 1.0)
    trapezium = frame_of((-10.0, 23.0, -6.5), (0.85, 0.4, -0.3), (0.0, 0.5, 0.9))
    trapezoid = frame_of((-6.6, 12.8, -0.5), (1.0, 0.1, 0.0), dorsal)
    capitate = frame_of((-10.4, 0.4, 0.0), (1.0, 0.0, 0.0), dorsal)
    hamate = frame_of((-12.2, -14.6, -1.0), (1.0, -0.1, 0.0), (0.0, -0.15, 1.0))

    def ball(frame: RigidTransform, centre: Array, radius: float) -> Implicit:
        x, y, z = frame.inverse()(centre)
        return ellipsoid((x, y, z), (radius,) * 3)

    return {
        "capitate": (
            smooth_union(
                [
                    rounded_box((1.5, 0.0, 0.3), (8.2, 6.0, 7.0), 3.0),
                    ellipsoid((-5.5, 0.0, 0.0), (5.2, 5.0, 5.4)),
                ],
                2.0,
            ),
            capitate,
        ),
        "trapezoid": (
            smooth_union(
                [
                    rounded_box((0.0, 0.0, 0.6), (5.4, 5.2, 6.0), 2.5),
                    ellipsoid((0.0, 0.0, 3.0), (4.8, 5.4, 4.0)),
                ],
                1.5,
            ),
            trapezoid,
        ),
        "hamate": (
            smooth_union(
                [
                    rounded_box((0.0, 0.0, 0.0), (7.6, 6.6, 6.2), 3.0),
                    ball(hamate, facet_centre(4), 6.2),
                    ball(hamate, facet_centre(5), 5.7),
                    ellipsoid((1.5, 1.0, -7.5), (3.2, 2.3, 4.2)),
                ],
                2.0,
            ),
            hamate,
        ),
        "trapezium": (
            smooth_union(
                [
                    rounded_box((-1.0, 0.0, 0.0), (5.8, 5.6, 6.2), 2.5),
                    ball(trapezium, saddle_centre(), 6.6),
                    ellipsoid((-1.0, -4.5, -4.0), (4.0, 2.2, 2.6)),
                ],
                2.0,
            ),
            trapezium,
        ),
    }


def bones(
    build: HandBuild | None = None,
    seats: Mapping[tuple[str, str], Callable[[Implicit], Implicit]] | None = None,
    bases: Mapping[str, Implicit] | None = None,
) -> dict[str, PlacedBone]:
    """All 23 bones, each hollowed by those before it that it may touch.

    build: of another hand than the median one, which before it has its size; cartilage is as thick in every
    hand. seats: by bone and the bone that hollows it, what changes the hollowing shape in the neutral frame,
    if anything does; bases: what is added to a bone, in its own frame, before it is hollowed.
    """
    placed, found = frames(build), dict[str, PlacedBone]()
    size = 1.0 if build is None else build.size

    def add(name: str, shape: Implicit, span: tuple[float, float], cortex: tuple[float, float]) -> None:
        frame = placed[name]
        if bases and name in bases:
            shape = smooth_union([shape, bases[name]], BASE_BLEND)
        for other in _before(name):
            gap = BASE_GAP if name.startswith("metacarpal") and other.startswith("metacarpal") else GAP
            obstacle = found[other].placed()
            if seats and (name, other) in seats:
                obstacle = seats[name, other](obstacle)
            shape = carved(shape, moved(obstacle, frame.inverse()), gap / size)
        found[name] = PlacedBone(with_marrow(shape, span, *cortex), frame)

    blocks = _carpal_blocks()
    for name in ("capitate", "trapezoid", "hamate", "trapezium"):
        add(name, blocks[name][0], (-11.0, 11.0), (0.7, 0.7))
    segments = rays(build)
    for ray in (3, 2, 4, 5, 1):
        for name, segment in segments[ray].items():
            bone = segment.bone()
            add(f"{name}{ray}", bone.shape(), bone.span, segment.kind.cortex)
    return found


BESIDE = {
    "trapezoid": ("capitate",),
    "hamate": ("capitate",),
    "trapezium": ("trapezoid",),
    "metacarpal3": ("capitate", "trapezoid", "hamate"),
    "metacarpal2": ("trapezoid", "capitate", "trapezium", "metacarpal3"),
    "metacarpal4": ("hamate", "capitate", "metacarpal3"),
    "metacarpal5": ("hamate", "metacarpal4"),
    "metacarpal1": ("trapezium", "trapezoid", "metacarpal2"),
}


def _before(name: str) -> tuple[str, ...]:
    """The bones that hollow a bone."""
    if name in BESIDE or name == "capitate":
        return BESIDE.get(name, ())
    kind, ray = name[:-1], int(name[-1])
    kinds = list(RAYS[ray])
    return (f"{kinds[kinds.index(kind) - 1]}{ray}",)
