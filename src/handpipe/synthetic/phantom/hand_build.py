"""How a generated hand differs from the median one: its size, its bones, its flesh, its joints.

Lengths are stated in mm of the finished hand. Everything is made at the size of the median hand, where the
gaps, the edges of meshes and the heights of curves hold, and then made `size` times as large.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array
from handpipe.synthetic.geometry.varied_shapes import Variation

GIRTH = 0.05  # largest deviation of a bone's girth from that of the hand
SHAPE = 0.4  # mm of the median hand: deviation of bones' surfaces, smooth over `varied_shapes.LENGTH`
AXIS, CENTRE = 3.0, 0.4  # deg and mm of the median hand: deviation of a joint's axes and centre
LEAST_REACH = 0.88  # of the median hand's angles in a pose, by the kind of joint
ANGLE, PALM_ANGLE = 2.0, 1.0  # deg: largest deviation of an angle in a pose; of the palm's joints
RESIDUAL = (0.6, 1.2)  # of the motion of the median hand's joints that no hinge has
VOLUME = 0.1  # largest deviation of a muscle's volume from that of the hand


@dataclass(frozen=True, eq=False)
class HandBuild:
    """A hand that differs from the median one.

    Parameters
    ----------
    name : str
        Its name, from which all that varies at random follows.
    size : float
        mm of this hand for a mm of the median one, across the bones and in the carpus.
    lengths : mapping of str to float
        Length in mm of each long bone of this hand.
    flesh : float
        Radius of the skin about the bones, as a share of that of the median hand made `size` times as large.
    """

    name: str
    size: float
    lengths: Mapping[str, float] = field(default_factory=dict)
    flesh: float = 1.0

    def length(self, bone: str) -> float:
        """Length in mm of a long bone before the hand is made `size` times as large."""
        return self.lengths[bone] / self.size

    def girth(self, bone: str) -> float:
        """Girth of a long bone as a share of the median hand's, at its size."""
        return float(self._random("girth", bone).uniform(1.0 - GIRTH, 1.0 + GIRTH))

    def volume(self, muscle: str) -> float:
        """Volume of a muscle on bones as long as the median hand's, as a share of that hand's."""
        return float(self.flesh**2 * self._random("volume", muscle).uniform(1.0 - VOLUME, 1.0))

    def shaped(self, points: Array) -> Array:
        """Where the shapes of this hand's bones and skin are, for points (n, 3) of the median's, in mm."""
        return Variation(zlib.crc32(self.name.encode()), "shape", SHAPE)(points)

    def joint_turn(self, joint: str) -> Array:
        """Rotation (3, 3) of a joint's axes."""
        turn = self._random("axis", joint).standard_normal(3)
        return Rotation.from_rotvec(np.radians(AXIS) * turn / np.sqrt(3.0)).as_matrix()

    def joint_shift(self, joint: str) -> Array:
        """Displacement (3,) in mm of a joint's centre, before the hand is made `size` times as large."""
        return CENTRE / np.sqrt(3.0) * self._random("centre", joint).standard_normal(3)

    def residual(self, joint: str) -> float:
        """Share of the median hand's motion that no hinge has."""
        return float(self._random("residual", joint).uniform(*RESIDUAL))

    def angles(self, pose: str, degrees: Mapping[str, float]) -> dict[str, float]:
        """Angles in degrees that this hand has where the median hand has those of a pose; zeros stay."""
        if not any(degrees.values()):
            return dict(degrees)
        found = {}
        for name, value in degrees.items():
            reach = self._random("reach", name.rstrip("abcdefghijklmnopqrstuvwxyz")).uniform(LEAST_REACH, 1.0)
            most = PALM_ANGLE if name.startswith("CMC") else ANGLE
            off = self._random("angle", f"{pose} {name}").uniform(-most, most)
            off = abs(off) if value < 0.0 else off  # the median hand's extension is nearly that of the limits
            found[name] = round(float(reach * value + off), 1)
        return found

    def _random(self, what: str, of: str) -> np.random.Generator:
        return np.random.default_rng([zlib.crc32(text.encode()) for text in (self.name, what, of)])
