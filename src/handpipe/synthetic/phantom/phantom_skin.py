"""The phantom's skin: a tube about the finger and its palm ray, bent by fractions of the joints' motions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.synthetic.geometry.kinematics import Posture, ramp, smoothstep
from handpipe.synthetic.geometry.tubes import close_rings
from handpipe.synthetic.phantom.phantom_muscles import KnownMuscle, contact_height

START, END = -9.5, 154.0  # mm, x of the skin's ends
CUT, TIP = 5.0, 11.0  # mm over which the skin closes at the cut end and at the tip
BANDS = {"MP2": (41.5, 75.0), "PIP2": (84.8, 118.0), "DIP2": (118.2, 136.8)}  # x over which the skin bends
NAIL = (141.0, 151.0, 5.0)  # mm: x from, x to, half width
# x, then how far the section reaches from the bone's axis: radial, ulnar, dorsal, palmar
PROFILE = np.array(
    [
        [-10.0, 14.5, 9.8, 10.8, 13.0],
        [8.0, 15.5, 10.2, 11.0, 13.4],
        [30.0, 17.6, 10.2, 10.6, 13.2],
        [45.0, 17.2, 10.2, 10.9, 13.6],
        [58.0, 13.6, 10.2, 11.6, 14.2],
        [68.0, 12.0, 9.8, 11.0, 13.0],
        [80.0, 9.4, 8.8, 9.2, 10.9],
        [90.0, 8.6, 8.4, 8.6, 10.6],
        [101.5, 9.2, 9.0, 8.8, 10.5],
        [112.0, 8.6, 8.3, 8.5, 10.1],
        [120.0, 7.8, 7.6, 7.9, 9.1],
        [127.0, 7.8, 7.6, 7.3, 9.2],
        [135.0, 7.6, 7.4, 7.3, 9.0],
        [143.0, 7.4, 7.3, 5.9, 8.6],
        [155.0, 7.0, 6.9, 5.2, 8.0],
    ]
)


def _stations(spacing: float) -> tuple[Array, Array]:
    """Coordinates x of the skin's rings and their size, evenly spaced along its profile.

    The size is 1 but where the skin closes.
    """
    closing = 1.0 - np.cos(np.linspace(0.0, 0.5 * np.pi, 2000))
    cut = START + CUT * (1.0 - (1.0 - closing**3) ** (1.0 / 3.0))
    tip = END - TIP + TIP * (1.0 - closing[::-1] ** 2) ** (1.0 / 2.3)
    middle = np.linspace(START + CUT, END - TIP, 2000)[1:-1]
    x, size = np.concatenate([cut, middle, tip]), np.concatenate([closing, np.ones(1998), closing[::-1]])
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), 10.0 * np.diff(size)))])
    at = np.linspace(0.0, arc[-1], int(arc[-1] / spacing))[1:-1]
    return np.interp(at, arc, x), np.interp(at, arc, size)


@dataclass(frozen=True)
class KnownSkin:
    """Neutral skin and the map that poses it. `muscles` make it bulge."""

    muscles: Mapping[str, KnownMuscle]

    def surface(self, spacing: float, sides: int, phase: float = 0.0) -> tuple[Array, IntArray]:
        """Closed neutral surface with rings about `spacing` mm apart and `sides` points a ring."""
        x, size = _stations(spacing)
        radial, ulnar, dorsal, palmar = (size * PchipInterpolator(PROFILE[:, 0], p)(x) for p in PROFILE.T[1:])
        angle = 2.0 * np.pi * (np.arange(sides) + phase) / sides
        c, s = np.cos(angle), np.sin(angle)
        width = np.where(c > 0, radial[:, None], ulnar[:, None])
        height = np.where(s > 0, dorsal[:, None], palmar[:, None])
        reach = ((np.abs(c) / width) ** 2.4 + (np.abs(s) / height) ** 2.4) ** (-1.0 / 2.4)
        points = np.stack([np.broadcast_to(x[:, None], reach.shape), reach * c, reach * s], axis=-1)
        points[..., 2] += 0.6 * smoothstep(x, END - 2 * TIP, END)[:, None] * -1.0
        start, end = points[0].mean(axis=0), points[-1].mean(axis=0)
        start[0], end[0] = START, END
        return close_rings(points, start, end)

    def fractions(self, x: Array) -> dict[str, Array]:
        """For each joint, the fraction (n,) in [0, 1] of its motion that points at x (n,) in mm follow."""
        return {joint: ramp(x, *band) for joint, band in BANDS.items()}

    def bulge(self, points: Array, posture: Posture, growth: Mapping[str, float]) -> Array:
        """Neutral points (n, 3) moved out over thickened muscles and on the palmar side of flexed joints."""
        x, y, z = points.T
        radial = smoothstep(y, 0.0, 12.0)
        moved = points.copy()
        for name, muscle in self.muscles.items():
            scale = muscle.thickening(x, posture) - 1.0 + growth[name] * muscle.bell(x)
            height = np.exp(-(((z - contact_height(x) - 3.0 * muscle.side) / 7.0) ** 2))
            moved[:, 1] += radial * height * scale * muscle.belly[0] * muscle.bell(x)
        for joint in posture.joints:
            low, high = BANDS[joint.name]
            flexed = 1.0 - np.cos(posture.angles[joint.angles[0]])
            share = np.exp(-(((x - joint.centre[0]) / (0.3 * (high - low))) ** 2)) * smoothstep(-z, 0.0, 5.0)
            moved[:, 2] += share * flexed * 0.33 * z
        return moved

    def pose(self, points: Array, posture: Posture, growth: Mapping[str, float]) -> Array:
        """Posed positions of neutral skin (or tissue) points (n, 3)."""
        bulged = self.bulge(points, posture, growth)
        posed = posture.bend(bulged, self.fractions(points[:, 0]))
        distal = posture.transforms()[posture.joints[-1].child]
        pressed = nail_motion(posture)
        moved = distal(pressed(bulged)) - distal(bulged)
        return posed + nail_share(points)[:, None] * moved


def nail_share(points: Array) -> Array:
    """1 on the nail, 0 a few mm away from it, by neutral position."""
    x, y, z = points.T
    start, end, half = NAIL
    along = smoothstep(x, start - 3.5, start - 0.5)
    across = 1.0 - smoothstep(np.abs(y), half + 0.3, half + 2.0)
    beyond = 1.0 - smoothstep(x, end + 0.2, end + 1.4)
    return along * across * beyond * smoothstep(z, -0.5, 1.2)


def nail_motion(posture: Posture) -> RigidTransform:
    """The nail's own small motion on the distal bone, in the neutral frame: it tips as the joint flexes."""
    share = np.sin(posture.angles["DIP2_flexion"])
    angle = np.radians(2.0) * share
    rotation = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1.0, 0], [-np.sin(angle), 0, np.cos(angle)]])
    about = RigidTransform.about(np.array([NAIL[0], 0.0, 4.0]), rotation)
    return RigidTransform(about.rotation, about.translation + share * np.array([0.0, 0.0, 0.25]))


def nail_triangles(points: Array, triangles: IntArray) -> IntArray:
    """Indices of the neutral skin's triangles that are nail."""
    return np.flatnonzero((nail_share(points) >= 1.0)[triangles].all(axis=1))
