"""The phantom finger's bones and joints in the neutral frame: +x distal, +y radial, +z dorsal, mm.

Lengths (metacarpal 65, proximal 40, middle 24, distal 18) are those of a median male index finger.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.synthetic.geometry.implicit import (
    Implicit,
    ellipsoid,
    offset,
    round_cone,
    smooth_union,
    triangulate,
)
from handpipe.synthetic.geometry.kinematics import KnownJoint, smoothstep

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Shaft:
    """A round cone from one end to the other."""

    start: Point
    end: Point
    radius_start: float
    radius_end: float

    def shape(self) -> Implicit:
        """Implicit function of the cone."""
        return round_cone(self.start, self.end, self.radius_start, self.radius_end)

    def resized(self, place: Callable[[Point], Point], girth: float) -> Shaft:
        """The cone with both ends moved by `place`, and its radii times `girth`."""
        radii = girth * self.radius_start, girth * self.radius_end
        return Shaft(place(self.start), place(self.end), *radii)


@dataclass(frozen=True)
class Lump:
    """An ellipsoid along the axes: a base, a condyle, a tubercle."""

    centre: Point
    radii: Point

    def shape(self) -> Implicit:
        """Implicit function of the ellipsoid."""
        return ellipsoid(self.centre, self.radii)

    def resized(self, place: Callable[[Point], Point], girth: float) -> Lump:
        """The ellipsoid with its centre moved by `place`, and its radii times `girth`."""
        x, y, z = self.radii
        return Lump(place(self.centre), (girth * x, girth * y, girth * z))


@dataclass(frozen=True)
class LongBone:
    """A long bone along x, from span[0] to span[1]: parts that run into one another over `blend` mm."""

    parts: tuple[Shaft | Lump, ...]
    blend: float
    span: tuple[float, float]

    def shape(self) -> Implicit:
        """The whole bone."""
        return smooth_union([part.shape() for part in self.parts], self.blend)

    def resized(self, length: float, girth: float) -> LongBone:
        """The bone from x = 0 to `length`, its ends scaled by `girth` and its shaft as long as is left."""
        low, high = self.span

        def place(point: Point) -> Point:
            x, y, z = point
            along = girth * (x - low) if x < 0.5 * (low + high) else length - girth * (high - x)
            return along, girth * y, girth * z

        parts = tuple(part.resized(place, girth) for part in self.parts)
        return LongBone(parts, girth * self.blend, (0.0, length))


METACARPAL = LongBone(
    (
        Shaft((6.0, 0.0, 0.3), (50.0, 0.0, 0.2), 4.9, 4.1),
        Lump((4.6, 0.6, 0.0), (4.6, 6.6, 6.0)),
        Lump((4.8, -3.2, -2.6), (4.4, 3.2, 3.0)),
        Lump((58.0, 0.0, 0.2), (6.6, 6.4, 6.6)),
        Lump((56.4, 3.4, -3.4), (4.6, 3.0, 3.2)),
        Lump((56.8, -3.0, -3.0), (4.6, 2.8, 2.8)),
        Lump((53.5, 4.6, 2.2), (2.6, 2.0, 2.2)),
    ),
    2.0,
    (0.0, 65.0),
)
PROXIMAL = LongBone(
    (
        Shaft((70.0, 0.0, 0.0), (98.0, 0.0, 0.0), 4.5, 3.7),
        Lump((70.2, 0.0, 0.0), (4.4, 6.8, 5.8)),
        Lump((70.6, 4.6, -2.4), (3.6, 2.4, 2.6)),
        Lump((70.6, -4.4, -2.2), (3.6, 2.2, 2.4)),
        Lump((101.6, 2.7, -0.7), (4.3, 2.9, 4.5)),
        Lump((101.2, -2.7, -0.6), (4.3, 2.7, 4.2)),
    ),
    1.8,
    (66.0, 106.0),
)
MIDDLE = LongBone(
    (
        Shaft((109.5, 0.0, 0.0), (124.0, 0.0, 0.0), 3.7, 2.9),
        Lump((109.6, 0.0, 0.0), (3.0, 5.3, 4.3)),
        Lump((109.4, 0.4, 2.9), (2.6, 2.2, 2.0)),
        Lump((127.2, 2.1, -0.4), (3.3, 2.2, 3.4)),
        Lump((126.9, -2.1, -0.3), (3.3, 2.1, 3.2)),
    ),
    1.5,
    (106.8, 130.7),
)
DISTAL = LongBone(
    (
        Shaft((134.0, 0.0, 0.0), (145.0, 0.0, 0.2), 2.9, 2.1),
        Lump((133.6, 0.0, 0.0), (2.5, 4.5, 3.5)),
        Lump((134.2, 2.9, -1.2), (2.2, 1.7, 1.7)),
        Lump((146.4, 0.2, 0.0), (3.0, 3.5, 2.0)),
        Lump((145.4, 0.0, -1.2), (2.4, 2.2, 1.7)),
    ),
    1.3,
    (131.3, 149.3),
)


@dataclass(frozen=True)
class KnownBone:
    """A bone: implicit shapes of the whole and of the marrow, and the span of its long axis in x."""

    whole: Implicit
    marrow: Implicit
    span: tuple[float, float]

    def surface(self, shape: Implicit, spacing: float) -> tuple[Array, IntArray]:
        """Closed surface of one of the bone's shapes."""
        reach = np.array([2.0, 12.0, 12.0])
        centre_start, centre_end = np.array([self.span[0], 0, 0]), np.array([self.span[1], 0, 0])
        return triangulate(shape, centre_start - reach, centre_end + reach, spacing)


def with_marrow(shape: Implicit, span: tuple[float, float], shaft: float, ends: float) -> KnownBone:
    """Marrow under a cortical shell `shaft` mm thick along the shaft and `ends` mm under the joints."""
    length = span[1] - span[0]

    def thickness(x: Array) -> Array:
        from_end = np.minimum(x[:, 0] - span[0], span[1] - x[:, 0])
        return ends + (shaft - ends) * smoothstep(from_end, 0.1 * length, 0.3 * length)

    return KnownBone(shape, offset(shape, thickness), span)


def bones() -> dict[str, KnownBone]:
    """The four bones in the neutral pose."""
    return {
        "metacarpal2": with_marrow(METACARPAL.shape(), METACARPAL.span, 1.5, 1.1),
        "proximal2": with_marrow(PROXIMAL.shape(), PROXIMAL.span, 1.4, 1.0),
        "middle2": with_marrow(MIDDLE.shape(), MIDDLE.span, 1.2, 1.0),
        "distal2": with_marrow(DISTAL.shape(), DISTAL.span, 1.0, 0.95),
    }


def _unit(*axis: float) -> Array:
    return np.array(axis) / np.linalg.norm(axis)


def joints() -> tuple[KnownJoint, ...]:
    """The joints, with slightly oblique axes and the motions that no pure hinge has."""
    turn, shift = np.radians, np.array
    return (
        KnownJoint(
            "MP2",
            "metacarpal2",
            "proximal2",
            ("MP2_flexion", "MP2_abduction"),
            np.array([_unit(0.05, 1.0, 0.03), _unit(0.06, 0.0, 1.0)]),
            np.array([58.2, 0.1, 0.0]),
            turn(shift([1.6, 0.0, 0.8])),
            shift([0.15, 0.1, -0.35]),
        ),
        KnownJoint(
            "PIP2",
            "proximal2",
            "middle2",
            ("PIP2_flexion",),
            np.array([_unit(-0.07, 1.0, 0.05)]),
            np.array([101.4, 0.0, -0.6]),
            turn(shift([1.2, 0.0, -0.7])),
            shift([0.1, 0.05, -0.3]),
        ),
        KnownJoint(
            "DIP2",
            "middle2",
            "distal2",
            ("DIP2_flexion",),
            np.array([_unit(0.06, 1.0, -0.04)]),
            np.array([127.0, 0.0, -0.3]),
            turn(shift([-1.0, 0.0, 0.6])),
            shift([0.05, 0.0, -0.2]),
        ),
    )
