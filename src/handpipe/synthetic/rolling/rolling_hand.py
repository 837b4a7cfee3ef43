"""A hand of bones whose joints roll: its poses, their equilibria, and a pose's files.

No joint has a fixed centre or fixed axes. What a joint does besides its driven angles depends on the flexor's
tension, and so on the other joints of its finger. The neutral pose is such an equilibrium, too, and lies off
the rest of the ligaments.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.synthetic.geometry.kinematics import KnownJoint, Posture
from handpipe.synthetic.phantom import phantom_hand, posed_hand
from handpipe.synthetic.phantom.hand_tissue import Layout, Surroundings
from handpipe.synthetic.phantom.phantom_hand_bones import FINGERS, REST, WITH_ROOT, PlacedBone
from handpipe.synthetic.phantom.phantom_hand_joints import POSES, joints
from handpipe.synthetic.phantom.posed_hand import Hand, HandMotion
from handpipe.synthetic.rolling import rolling_anatomy as anatomy
from handpipe.synthetic.rolling.equilibrium import RollingJoint

NAME = "phantom-hand-rolling"
SURFACE_SPACING = phantom_hand.SURFACE_SPACING
DIP_OF_PIP = 2 / 3  # flexion of the DIP joint for that of the PIP joint (Rijpkema and Girard 1991)
ABDUCTION = 25.0  # deg, most of a straight finger at its MP joint; in proportion to none at a right angle
LEAST_ABDUCTION = 2.0  # deg that are left at a right angle
STRIDE = np.radians(15.0)  # longest way of a driven angle from one equilibrium to the next
# Degrees, where bones of neighbouring fingers would meet.
CHANGES: dict[str, dict[str, float]] = {
    "fist": {"MP5_abduction": -2, "MP4_abduction": 0},
    "bow": {"MP2_abduction": 3.9, "MP3_abduction": -1},
    "oppose_ring": {"TM_flexion": 26},
    "point": {"MP5_abduction": -1.5, "MP4_abduction": 0.5},
}


def coupled(angles: Mapping[str, float]) -> dict[str, float]:
    """Angles in degrees of a pose as neighbours allow them: DIP by PIP, MP's abduction by its flexion."""
    found = dict(angles)
    for ray in FINGERS:
        found[f"DIP{ray}_flexion"] = round(DIP_OF_PIP * angles[f"PIP{ray}_flexion"], 1)
        bent = angles[f"MP{ray}_flexion"] + REST[ray][0]
        most = max(ABDUCTION * min(1 - bent / 90.0, 1.0), LEAST_ABDUCTION)
        found[f"MP{ray}_abduction"] = round(float(np.clip(angles[f"MP{ray}_abduction"], -most, most)), 1)
    return found


@dataclass(frozen=True)
class RollingPosture(Posture):
    """A pose of the bones as built, and where its equilibria put each child on its parent.

    motions: of each joint's child relative to its parent, from the built hand to the pose, mm; neutral: of
    each bone from the built hand to neutral, mm.
    """

    motions: Mapping[str, RigidTransform] = field(default_factory=dict)
    neutral: Mapping[str, RigidTransform] = field(default_factory=dict)

    def transforms(self) -> dict[str, RigidTransform]:
        """Each bone's transform from the neutral frame into the pose's."""
        placed = _chained(self.joints, self.motions, self.root)
        return {bone: there @ self.neutral[bone].inverse() for bone, there in placed.items()}


def _chained(
    joints: Sequence[KnownJoint], motions: Mapping[str, RigidTransform], root: RigidTransform
) -> dict[str, RigidTransform]:
    """Transforms of all bones from the built hand by motions of the joints."""
    placed = dict.fromkeys((joints[0].parent, *WITH_ROOT), root)
    for joint in joints:
        placed[joint.child] = placed[joint.parent] @ motions[joint.name]
    return placed


@dataclass(frozen=True)
class BuiltHand:
    """The hand before it comes to rest: bones, and joints whose children are not yet in equilibrium.

    Parameters
    ----------
    known : tuple of KnownJoint
        Names, bones, driven angles and nominal axes of the joints, outwards.
    bones : dict of str to PlacedBone
        Shapes of the bones.
    surfaces : dict of str to surface
        Whole bones, mm.
    rolling : dict of str to RollingJoint
        The joints by name.
    """

    known: tuple[KnownJoint, ...]
    bones: dict[str, PlacedBone]
    surfaces: dict[str, tuple[Array, IntArray]]
    rolling: dict[str, RollingJoint]

    def rest(self, joint: KnownJoint, angles: Mapping[str, float]) -> Array:
        """Coordinates (6,) of a joint's equilibrium at all of the hand's angles in rad."""
        rolling = self.rolling[joint.name]
        rolling = rolling.with_tension(anatomy.tensions(rolling, bent(joint, angles)))
        end = np.array([angles[name] for name in joint.angles])
        strides = max(int(np.ceil(np.abs(end).max() / STRIDE)), 1)
        way = [share * end for share in np.linspace(0, 1, strides + 1)]
        return rolling.path(np.zeros(6), way)[-1]

    def motions(self, angles: Mapping[str, float]) -> dict[str, RigidTransform]:
        """Motions of all joints' children from the built hand at angles in rad."""
        return {j.name: self.rolling[j.name].motion(self.rest(j, angles)) for j in self.known}


def bent(joint: KnownJoint, angles: Mapping[str, float]) -> float:
    """Flexion in rad from a straight finger, the mean over the joints of the ray that a joint belongs to."""
    ray = int(joint.child[-1])
    flexions = [v for n, v in angles.items() if n.endswith("flexion") and n.split("_")[0] in _joints_of(ray)]
    return float((np.sum(flexions) + np.radians(sum(REST[ray]))) / len(flexions))


@cache
def _joints_of(ray: int) -> frozenset[str]:
    return frozenset(joint.name for joint in joints() if joint.child.endswith(str(ray)))


@cache
def built() -> BuiltHand:
    """The one hand of rolling joints, as built."""
    known = joints()
    bones = anatomy.shallow_bones(known)
    surfaces = {n: b.surface(b.known.whole, SURFACE_SPACING) for n, b in bones.items()}
    lean = {j.name: anatomy.LEAN * (1 if int(j.child[-1]) % 2 else -1) for j in known}
    rolling = {j.name: anatomy.rolling_joint(j, surfaces, lean[j.name]) for j in known}
    return BuiltHand(known, bones, surfaces, rolling)


@cache
def neutral_motions() -> dict[str, RigidTransform]:
    """Motions of the joints' children from the built hand to neutral."""
    return built().motions(_radians("neutral"))


@cache
def neutral() -> dict[str, RigidTransform]:
    """Each bone's transform from the built hand to neutral."""
    return _chained(built().known, neutral_motions(), RigidTransform.identity())


@cache
def hand() -> Hand:
    """The hand in neutral."""
    moved = neutral()

    def surface(name: str, whole: bool) -> tuple[Array, IntArray]:
        bone = built().bones[name]
        points, triangles = bone.surface(bone.known.whole if whole else bone.known.marrow, SURFACE_SPACING)
        return moved[name](points), triangles

    layout = phantom_hand.layout()
    frames = {name: moved[name] @ frame for name, frame in layout.frames.items()}
    return Hand(
        {name: surface(name, True) for name in built().bones},
        {name: surface(name, False) for name in built().bones},
        Surroundings.build(Layout(frames, layout.chains)),
    )


def _radians(pose: str) -> dict[str, float]:
    return {name: float(np.radians(value)) for name, value in poses()[pose].items()}


@cache
def poses() -> dict[str, dict[str, float]]:
    """Driven angles in degrees by pose and name."""
    return {pose: coupled(angles | CHANGES.get(pose, {})) for pose, angles in POSES.items()}


def motion() -> HandMotion:
    """The joints, where neutral has their nominal axes and centres, and the angles of all poses."""
    moved = neutral()

    def carried(joint: KnownJoint) -> KnownJoint:
        place = moved[joint.parent]
        return replace(joint, centre=place(joint.centre), axes=joint.axes @ place.rotation.T)

    known = tuple(carried(joint) for joint in built().known)
    return HandMotion(NAME, known, poses())


@cache
def posture(pose: str, seed: int) -> RollingPosture:
    """Posture of a named pose; the root is repositioned by up to 5 degrees and 6 mm in all but neutral."""
    driven = motion().posture(pose, seed)
    return RollingPosture(
        driven.joints, driven.angles, driven.root, WITH_ROOT, built().motions(driven.angles), neutral()
    )


def generate_pose(dataset: Dataset, pose: str) -> None:
    """Write a pose's volume, truth and label volumes where the dataset names them; `seeds.draw` adds seeds.

    Raises
    ------
    InputError
        For an unknown pose, and for parts that this hand does not have.
    """
    posed_hand.require_bones_alone(dataset, built().bones)
    posed_hand.write_pose(dataset, pose, hand().posed(posture(pose, dataset.seed)))


def generate_templates(dataset: Dataset) -> None:
    """Write the templates of bones that the dataset names: their own neutral surfaces.

    Raises
    ------
    InputError
        For templates of muscles and others that this hand does not have.
    """
    posed_hand.require_bones_alone(dataset, built().bones)
    posed_hand.write_templates(dataset, hand().posed(posture("neutral", dataset.seed)))
