"""The phantom finger's bones and joints in the neutral frame: +x distal, +y radial, +z dorsal, mm.

Lengths (metacarpal 65, proximal 40, middle 24, distal 18) are those of a median male index finger.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handpipe.datasets.implicit import Implicit, ellipsoid, offset, round_cone, smooth_union, triangulate
from handpipe.datasets.kinematics import KnownJoint, smoothstep

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]


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


def _metacarpal() -> Implicit:
    return smooth_union(
        [
            round_cone((6.0, 0.0, 0.3), (50.0, 0.0, 0.2), 4.9, 4.1),
            ellipsoid((4.6, 0.6, 0.0), (4.6, 6.6, 6.0)),
            ellipsoid((4.8, -3.2, -2.6), (4.4, 3.2, 3.0)),
            ellipsoid((58.0, 0.0, 0.2), (6.6, 6.4, 6.6)),
            ellipsoid((56.4, 3.4, -3.4), (4.6, 3.0, 3.2)),
            ellipsoid((56.8, -3.0, -3.0), (4.6, 2.8, 2.8)),
            ellipsoid((53.5, 4.6, 2.2), (2.6, 2.0, 2.2)),
        ],
        2.0,
    )


def _proximal() -> Implicit:
    return smooth_union(
        [
            round_cone((70.0, 0.0, 0.0), (98.0, 0.0, 0.0), 4.5, 3.7),
            ellipsoid((70.2, 0.0, 0.0), (4.4, 6.8, 5.8)),
            ellipsoid((70.6, 4.6, -2.4), (3.6, 2.4, 2.6)),
            ellipsoid((70.6, -4.4, -2.2), (3.6, 2.2, 2.4)),
            ellipsoid((101.6, 2.7, -0.7), (4.3, 2.9, 4.5)),
            ellipsoid((101.2, -2.7, -0.6), (4.3, 2.7, 4.2)),
        ],
        1.8,
    )


def _middle() -> Implicit:
    return smooth_union(
        [
            round_cone((109.5, 0.0, 0.0), (124.0, 0.0, 0.0), 3.7, 2.9),
            ellipsoid((109.6, 0.0, 0.0), (3.0, 5.3, 4.3)),
            ellipsoid((109.4, 0.4, 2.9), (2.6, 2.2, 2.0)),
            ellipsoid((127.2, 2.1, -0.4), (3.3, 2.2, 3.4)),
            ellipsoid((126.9, -2.1, -0.3), (3.3, 2.1, 3.2)),
        ],
        1.5,
    )


def _distal() -> Implicit:
    return smooth_union(
        [
            round_cone((134.0, 0.0, 0.0), (145.0, 0.0, 0.2), 2.9, 2.1),
            ellipsoid((133.6, 0.0, 0.0), (2.5, 4.5, 3.5)),
            ellipsoid((134.2, 2.9, -1.2), (2.2, 1.7, 1.7)),
            ellipsoid((146.4, 0.2, 0.0), (3.0, 3.5, 2.0)),
            ellipsoid((145.4, 0.0, -1.2), (2.4, 2.2, 1.7)),
        ],
        1.3,
    )


def _with_marrow(shape: Implicit, span: tuple[float, float], shaft: float, ends: float) -> KnownBone:
    """Marrow under a cortical shell that is thick along the shaft and thinner under the joints."""
    length = span[1] - span[0]

    def thickness(x: Array) -> Array:
        from_end = np.minimum(x[:, 0] - span[0], span[1] - x[:, 0])
        return ends + (shaft - ends) * smoothstep(from_end, 0.1 * length, 0.3 * length)

    return KnownBone(shape, offset(shape, thickness), span)


def bones() -> dict[str, KnownBone]:
    """The four bones in the neutral pose."""
    return {
        "metacarpal2": _with_marrow(_metacarpal(), (0.0, 65.0), 1.5, 1.1),
        "proximal2": _with_marrow(_proximal(), (66.0, 106.0), 1.4, 1.0),
        "middle2": _with_marrow(_middle(), (106.8, 130.7), 1.2, 1.0),
        "distal2": _with_marrow(_distal(), (131.3, 149.3), 1.0, 0.95),
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
