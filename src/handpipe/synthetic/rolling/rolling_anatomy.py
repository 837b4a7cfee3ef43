"""The rolling hand's joints as built: heads in shallow bases, cartilage, ligaments of uneven sides, a flexor.

Bones are the phantom hand's, but each base is wider than the head on which it lies, so that it can roll.
Places of ligaments are in units of a joint's radius, in its own frame (distal, along flexion's axis,
dorsal), and are then moved onto the bones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.mesh.surfaces import Distance
from handpipe.mesh.surfaces import Surface as Mesh
from handpipe.synthetic.geometry.implicit import Implicit, rounded_box
from handpipe.synthetic.geometry.kinematics import KnownJoint
from handpipe.synthetic.phantom.phantom_bones import Point
from handpipe.synthetic.phantom.phantom_hand_bones import RAYS, PlacedBone, bones
from handpipe.synthetic.rolling.articular import Cartilage, Contact
from handpipe.synthetic.rolling.bands import Bands
from handpipe.synthetic.rolling.equilibrium import RollingJoint

Surface = tuple[Array, IntArray]

# How much larger the radius of a base is than that of the head on which it lies, by kind of joint.
WIDER = {"TM": 1.12, "MP": 1.12, "PIP": 1.08, "DIP": 1.08, "IP": 1.08, "CMC": 1.08}
# Rims added to bases so that they hold the heads: middle and half sizes of a rounded box at girth 1, mm.
RIMS: dict[str, tuple[Point, Point]] = {
    "metacarpal": ((1.2, 0.0, 0.0), (2.9, 5.8, 5.4)),
    "proximal": ((1.2, 0.0, 0.6), (2.9, 6.2, 5.0)),
    "middle": ((1.2, 0.0, 0.6), (2.9, 5.0, 3.7)),
    "distal": ((1.1, 0.0, 0.4), (2.5, 4.0, 3.1)),
}
RIM_ROUNDING = 1.5  # mm at girth 1, radius of a rim's edges
BESIDE_MORE = 0.5  # mm more between the bases of metacarpals IV and V, which move apart and together
CARTILAGE = Cartilage(0.9, 4000.0, 0.42)  # mm of both layers, kPa, Poisson's ratio
REACH = 4.5  # mm beyond a joint's radius: what of the moving bone may come to lie on the other
HALF_WIDTH = 1.6  # radii at which a ligament's nominal place lies beside the joint, then it is moved to bone


@dataclass(frozen=True)
class Band:
    """A ligament or tendon: its ends in radii of the joint, and how it pulls.

    Parameters
    ----------
    origin, insertion : tuple of float
        On the bone that stays and on the moving bone: distal, radial, dorsal of the joint's centre.
    stiffness : float
        In N for a unit strain; 0 is a tendon.
    taut : float
        Flexion in degrees at which it is `strain` longer than slack.
    strain : float
        Strain at that flexion.
    """

    origin: Point
    insertion: Point
    stiffness: float
    taut: float = 0.0
    strain: float = 0.0

    @property
    def tendon(self) -> bool:
        """Whether it is a tendon, which pulls with a tension of its own."""
        return self.stiffness == 0

    def beside(self, lean: float) -> Band:
        """The band moved to the radial side by `lean` radii."""
        (x, y, z), (a, b, c) = self.origin, self.insertion
        return replace(self, origin=(x, y + lean, z), insertion=(a, b + lean, c))


# Collateral ligaments are fans from near the centre, dorsal and proximal of it: the fibres to the palmar
# side of the base are taut in extension, those to its dorsal side in flexion. The radial fan is stiffer and
# shorter. Neutral is the rest of no fan.
LIGAMENTS = (
    Band((-0.10, HALF_WIDTH, 0.22), (1.20, HALF_WIDTH, 0.45), 150.0, taut=50.0, strain=0.025),
    Band((-0.10, -HALF_WIDTH, 0.22), (1.20, -HALF_WIDTH, 0.45), 120.0, taut=50.0, strain=0.015),
    Band((-0.10, HALF_WIDTH, 0.22), (1.30, HALF_WIDTH, -0.35), 400.0, taut=55.0, strain=0.03),
    Band((-0.10, -HALF_WIDTH, 0.22), (1.30, -HALF_WIDTH, -0.35), 300.0, taut=55.0, strain=0.02),
    Band((-0.15, HALF_WIDTH, 0.10), (1.00, HALF_WIDTH, -0.95), 150.0, taut=0.0, strain=0.025),
    Band((-0.15, -HALF_WIDTH, 0.10), (1.00, -HALF_WIDTH, -0.95), 120.0, taut=0.0, strain=0.03),
    Band((-0.90, 0.40, -1.10), (1.30, 0.40, -0.85), 180.0, taut=-10.0, strain=0.04),
    Band((-0.90, -0.40, -1.10), (1.30, -0.40, -0.85), 180.0, taut=-10.0, strain=0.03),
)
FLEXOR = Band((-1.6, 0.0, -1.35), (1.7, 0.0, -1.25), 0.0)
EXTENSOR = Band((-0.4, 0.0, 1.35), (1.2, 0.0, 1.15), 0.0)
LEAN = 0.12  # radii by which the flexor lies beside the middle, to the radial side in every other ray
TONE = 6.0  # N, tension of the flexor and of the extensor of a straight finger
GRIP = 8.0  # N more in the flexor when all its joints are bent by a right angle


def kind_of(joint: str) -> str:
    """Kind of a joint by its name."""
    return joint.rstrip("0123456789")


def frame_of_joint(joint: KnownJoint) -> Array:
    """Axes (3, 3) in columns: distal, flexion, dorsal; flexion as the joint has it."""
    y = joint.axes[0]
    x = joint.direction - (joint.direction @ y) * y
    x /= np.linalg.norm(x)
    return np.column_stack([x, y, np.cross(x, y)])


def shallow_bones(joints: tuple[KnownJoint, ...]) -> dict[str, PlacedBone]:
    """The phantom hand's bones, each base hollowed by a larger head that touches the true one."""

    def seat(joint: KnownJoint) -> tuple[tuple[str, str], _Seat]:
        return (joint.child, joint.parent), _Seat(joint.centre, joint.direction, WIDER[kind_of(joint.name)])

    moving = {joint.child for joint in joints}

    def rim(kind: str, girth: float) -> Implicit:
        centre, half = (_times(part, girth) for part in RIMS[kind])
        return rounded_box(centre, half, girth * RIM_ROUNDING)

    rims = {
        f"{kind}{ray}": rim(kind, s.girth)
        for ray, segments in RAYS.items()
        for kind, s in segments.items()
        if f"{kind}{ray}" in moving
    }
    seats: dict[tuple[str, str], Callable[[Implicit], Implicit]] = dict(seat(joint) for joint in joints)
    seats["metacarpal5", "metacarpal4"] = lambda beside: lambda points: beside(points) - BESIDE_MORE
    return bones(seats=seats, bases=rims)


def _times(point: Point, factor: float) -> Point:
    x, y, z = point
    return factor * x, factor * y, factor * z


@dataclass(frozen=True)
class _Seat:
    centre: Array
    direction: Array
    wider: float

    def __call__(self, head: Implicit) -> Implicit:
        """The head, larger, where it still touches its own middle from inside."""

        def along(distance: float) -> float:
            return float(head((self.centre + distance * self.direction)[None])[0])

        radius = brentq(along, 0.0, 20.0)  # mm
        shift = (self.wider - 1) * radius * self.direction
        return lambda points: self.wider * head(self.centre + (points - self.centre + shift) / self.wider)


def rolling_joint(joint: KnownJoint, surfaces: Mapping[str, Surface], lean: float = LEAN) -> RollingJoint:
    """The joint as built, in equilibrium nowhere yet.

    Parameters
    ----------
    joint : KnownJoint
        Its bones, driven angles, nominal axes and centre; the residual motions do not count.
    surfaces : mapping of str to surface
        Bones in the neutral frame, mm.
    lean : float
        Where the flexor lies beside the middle, in radii.
    """
    frame, fixed, moving = frame_of_joint(joint), surfaces[joint.parent], surfaces[joint.child]
    radius = float(np.linalg.norm(moving[0] - joint.centre, axis=1).min())
    contact = Contact.between(fixed, moving, joint.centre, radius + REACH, CARTILAGE)
    every = [*LIGAMENTS, *(tendon.beside(lean) for tendon in (FLEXOR, EXTENSOR))]
    places = [joint.centre + radius * np.array([b.origin for b in every]) @ frame.T,
              joint.centre + radius * np.array([b.insertion for b in every]) @ frame.T]  # fmt: skip
    ligament = np.array([not b.tendon for b in every])
    for ends, bone in zip(places, (fixed, moving), strict=True):
        ends[ligament] = Distance(Mesh(*bone)).closest(ends[ligament])[2]
    origins, insertions = places
    taut = np.array(
        [
            RigidTransform.about(
                joint.centre, Rotation.from_rotvec(np.radians(b.taut) * frame[:, 1]).as_matrix()
            )(end)
            for b, end in zip(every, insertions, strict=True)
        ]
    )
    slack = np.linalg.norm(taut - origins, axis=1) / (1 + np.array([b.strain for b in every]))
    bands = Bands(origins, insertions, slack, 1000 * np.array([b.stiffness for b in every]),
                  np.where(ligament, 0.0, 1000 * TONE))  # fmt: skip
    driven = (1, 2)[: len(joint.angles)]
    return RollingJoint(joint.centre, frame, contact, bands, driven)


def tensions(joint: RollingJoint, bent: float) -> Array:
    """Tensions (n,) in mN of a joint's bands where its finger's joints are bent by `bent` rad on average."""
    force = np.zeros(len(joint.bands.slack))
    force[-2:] = TONE + GRIP * max(bent, 0.0) / (np.pi / 2), TONE
    return 1000 * force
