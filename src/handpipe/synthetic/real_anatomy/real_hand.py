"""A hand of real bones that moves, and is imaged, as the phantom hand does.

Names of bones, joints, angles and poses, and the motions that no fixed axis explains, are the phantom hand's;
shapes, axes and centres are the source's. What no source has is made: axes of the metacarpals IV and V on the
hamate, and the thumb's abduction at its MP joint.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.synthetic.acquisition import sampled
from handpipe.synthetic.geometry.kinematics import KnownJoint
from handpipe.synthetic.phantom import phantom_hand_bones, phantom_hand_joints, posed_hand
from handpipe.synthetic.phantom.hand_tissue import Layout, Place, Strand, Surroundings
from handpipe.synthetic.phantom.posed_hand import Hand, HandMotion
from handpipe.synthetic.real_anatomy import carving

Surface = tuple[Array, IntArray]
Bones = Mapping[str, Surface]
log = logging.getLogger(__name__)

CARPALS = ("trapezium", "trapezoid", "capitate", "hamate")
RAYS = {ray: tuple(f"{kind}{ray}" for kind in kinds) for ray, kinds in phantom_hand_bones.RAYS.items()}
GAP = 0.4  # mm of cartilage between bones that would touch
CARPAL_CORTEX = 0.7  # mm, at the shaft and at the ends
METACARPAL_PIVOT = 5.0  # mm before the base of metacarpals IV and V: the middle of their motion on the hamate
# Half widths in mm of the phantom finger's heads, and of its distal bone's base: what a girth of 1 is.
HALF_WIDTHS = {"metacarpal": 6.4, "proximal": 5.6, "middle": 4.3, "distal": 4.6}


@dataclass(frozen=True)
class SourceHinge:
    """What the source says of one angle in the neutral pose: unit axis (3,) and centre (3,) in mm."""

    axis: Array
    centre: Array

    def moved(self, transform: RigidTransform) -> SourceHinge:
        """The hinge after a rigid motion."""
        return SourceHinge(transform.rotation @ self.axis, transform(self.centre))


@dataclass(frozen=True)
class Subject:
    """A hand in neutral and how it moves."""

    hand: Hand
    motion: HandMotion

    def generate_pose(self, dataset: Dataset, pose: str) -> None:
        """Write a pose's files (`posed_hand.write_pose`); `InputError` for what this hand does not have."""
        posed_hand.require_bones_alone(dataset, self.hand.bones)
        posed_hand.write_pose(dataset, pose, self.hand.posed(self.motion.posture(pose, dataset.seed)))

    def generate_templates(self, dataset: Dataset) -> None:
        """Write the templates of bones that the dataset names: their own neutral surfaces."""
        posed_hand.require_bones_alone(dataset, self.hand.bones)
        neutral = self.hand.posed(self.motion.posture("neutral", dataset.seed))
        posed_hand.write_templates(dataset, neutral)


def hand_frame(bones: Bones) -> RigidTransform:
    """From a right hand's own frame to the neutral one: origin at metacarpal III's base, +x along it.

    +y is radial, from metacarpal V to II as far as it is perpendicular to x, and +z dorsal.
    """
    points = {name: bones[name][0] for name in ("metacarpal2", "metacarpal3", "metacarpal5", "proximal3")}
    middle = {name: p.mean(axis=0) for name, p in points.items()}
    distal = long_axis(points["metacarpal3"], middle["proximal3"] - middle["metacarpal3"])
    axes = axes_along(distal, middle["metacarpal2"] - middle["metacarpal5"])
    return own_frame(points["metacarpal3"], axes).inverse()


def long_axis(points: Array, outwards: Array) -> Array:
    """Unit vector along a bone's points (n, 3), to the side of a rough direction (3,)."""
    axis = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][0]
    return axis * np.sign(axis @ outwards)


def axes_along(distal: Array, radial: Array) -> Array:
    """Rotation (3, 3) whose columns are distal, radial (made perpendicular) and dorsal of a right hand."""
    y = radial - (radial @ distal) * distal
    y /= np.linalg.norm(y)
    return np.column_stack([distal, y, np.cross(distal, y)])


def own_frame(points: Array, axes: Array) -> RigidTransform:
    """A long bone's own frame with given axes, its origin on the middle line at the near end."""
    middle = points.mean(axis=0)
    return RigidTransform(axes, middle + ((points - middle) @ axes[:, 0]).min() * axes[:, 0])


def own_frames(bones: Bones, hinges: Mapping[str, SourceHinge]) -> dict[str, RigidTransform]:
    """Where each bone's own frame lies in the neutral hand, as `hand_tissue.Layout` wants them.

    A long bone's +y is along the flexion axis of the joint before it, a metacarpal's of the one after it.
    """
    middle = {name: points.mean(axis=0) for name, (points, _) in bones.items()}
    found = {
        name: RigidTransform(phantom_hand_bones.frames()[name].rotation, middle[name]) for name in CARPALS
    }
    for ray, chain in RAYS.items():
        joints = ("MP", "MP", "PIP", "DIP") if len(chain) == 4 else ("MP", "MP", "IP")
        for i, (name, joint) in enumerate(zip(chain, joints, strict=True)):
            inner, outer = (chain[i - 1], name) if i else (name, chain[1])
            distal = long_axis(bones[name][0], middle[outer] - middle[inner])
            axes = axes_along(distal, hinges[f"{joint}{ray}_flexion"].axis)
            found[name] = own_frame(bones[name][0], axes)
    return found


def joints(frames: Mapping[str, RigidTransform], hinges: Mapping[str, SourceHinge]) -> tuple[KnownJoint, ...]:
    """The phantom hand's joints with the source's axes and centres; what has none lies as the phantom's."""
    theirs, found = phantom_hand_bones.frames(), []
    for known in phantom_hand_joints.joints():
        frame = frames[known.child]
        turn = frame.rotation @ theirs[known.child].rotation.T
        given = [hinges[angle] for angle in known.angles if angle in hinges]
        axes, centre = known.axes @ turn.T, frame(np.array([-METACARPAL_PIVOT, 0.0, 0.0]))
        if given:
            axes, centre = np.array([hinge.axis for hinge in given]), given[0].centre
        if len(axes) < len(known.angles):
            abduction = np.cross(frame.rotation[:, 0], axes[0])
            axes = np.vstack([axes, abduction / np.linalg.norm(abduction)])
        found.append(
            replace(
                known,
                axes=axes,
                centre=centre,
                residual_rotation=turn @ known.residual_rotation,
                residual_translation=turn @ known.residual_translation,
                direction=frame.rotation[:, 0],
            )
        )
    return tuple(found)


def layout(bones: Bones, frames: Mapping[str, RigidTransform]) -> Layout:
    """Where the bones lie, how long and how wide they are."""
    chains = {}
    for ray, chain in RAYS.items():
        sizes = []
        for name in chain:
            own = frames[name].inverse()(bones[name][0])
            kind, length = name[:-1], float(own[:, 0].max())
            end = own[:, 0] < 0.3 * length if kind == "distal" else own[:, 0] > 0.8 * length
            girth = 0.5 * float(np.ptp(own[end, 1])) / HALF_WIDTHS[kind]
            sizes.append((name, length, girth))
        chains[ray] = tuple(sizes)
    return Layout(frames, chains)


def poses(
    limits: Mapping[str, tuple[float, float]], changes: Mapping[str, Mapping[str, float]]
) -> dict[str, dict[str, float]]:
    """The phantom hand's poses in degrees, with changes, within limits of the angles where there are any."""

    def within(angle: str, value: float) -> float:
        low, high = limits.get(angle, (-np.inf, np.inf))
        return float(np.clip(value, low, high))

    return {
        pose: {angle: within(angle, value) for angle, value in {**angles, **changes.get(pose, {})}.items()}
        for pose, angles in phantom_hand_joints.POSES.items()
    }


def subject(
    name: str, bones: Bones, hinges: Mapping[str, SourceHinge], poses: dict[str, dict[str, float]]
) -> Subject:
    """The subject of closed neutral bones and of the source's hinges by angle."""
    frames = own_frames(bones, hinges)
    motion = HandMotion(name, joints(frames, hinges), poses)
    postures = [motion.posture(pose, 0) for pose in poses]
    sound = {n: carving.without_handles(s, n) for n, s in bones.items()}
    whole = carving.kept_apart(sound, touching(motion.joints), postures, GAP)
    lie = layout(whole, frames)
    cortex = _cortex(lie)
    shapes = {n: sampled.of_surface(s, carving.SPACING, carving.REACH) for n, s in whole.items()}
    marrow = {n: carving.marrow(s, shapes[n], frames[n], *cortex[n]) for n, s in whole.items()}
    surroundings = Surroundings.build(lie)
    surroundings = replace(
        surroundings,
        tendons=[_laid_on(strand, shapes, frames) for strand in surroundings.tendons],
        ligaments=[_laid_on(strand, shapes, frames) for strand in surroundings.ligaments],
    )
    return Subject(Hand(whole, marrow, surroundings), motion)


def touching(joints: Sequence[KnownJoint]) -> set[tuple[str, str]]:
    """Pairs of bones that lie on one another: of a joint, or neighbours in the palm."""
    pairs = {(joint.parent, joint.child) for joint in joints}
    pairs |= {(name, other) for name, others in phantom_hand_bones.BESIDE.items() for other in others}
    return {(min(pair), max(pair)) for pair in pairs}


def _cortex(layout: Layout) -> dict[str, tuple[float, float]]:
    """Thickness in mm along each bone's shaft and at its ends: the phantom hand's, thinner in thin bones."""
    found = dict.fromkeys(CARPALS, (CARPAL_CORTEX, CARPAL_CORTEX))
    for chain in layout.chains.values():
        for name, _, girth in chain:
            shaft, ends = phantom_hand_bones.KINDS[name[:-1]].cortex
            found[name] = girth * shaft, girth * ends
    return found


def _laid_on(
    strand: Strand, shapes: Mapping[str, sampled.Implicit], frames: Mapping[str, RigidTransform]
) -> Strand:
    """The strand with those of its places that lie beside a long bone brought into touch with its surface."""
    radii = np.arange(0.0, 14.0, 0.1)

    def touch(place: Place) -> Place:
        bone, (x, y, z) = place
        out = np.array([0.0, y, z]) / np.hypot(y, z)
        line = np.array([x, 0.0, 0.0]) + radii[:, None] * out
        clear = shapes[bone](frames[bone](line)) - (strand.radius - 0.15)
        if bone in CARPALS or not (clear < 0.0).any():
            return place
        at = line[np.flatnonzero(clear < 0.0)[-1]]
        return bone, (float(at[0]), float(at[1]), float(at[2]))

    return replace(strand, places=tuple(touch(place) for place in strand.places))
