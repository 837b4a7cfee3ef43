"""Which way is distal, dorsal and radial in a hand: from its joints, whatever the axes of its images."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.skeleton.joints.joint_tree import JointTree, RigJoint

AGREE = 0.7  # least cosine between the directions of two fingers; a thumb's differ more
BALL = 3  # angles of a ball joint
MOVING = 3  # joints of a finger that move: at its knuckle and its two hinges


@dataclass(frozen=True)
class HandDirections:
    """Anatomical directions of a hand: unit vectors, perpendicular to one another.

    Parameters
    ----------
    distal : array (3,)
        From the wrist to the knuckles, along the metacarpals.
    dorsal : array (3,)
        From the palm to the back.
    radial : array (3,)
        From the little finger's side to the thumb's.
    bone : str
        Bone with which the directions move: the middle finger's metacarpal.
    """

    distal: Array
    dorsal: Array
    radial: Array
    bone: str

    def moved(self, bones: Mapping[str, RigidTransform]) -> HandDirections:
        """The directions in a frame, as its metacarpal has turned.

        Parameters
        ----------
        bones : mapping of str to RigidTransform
            Transforms from neutral, in mm, by bone. Without `bone` the directions stay.

        Returns
        -------
        HandDirections
            Directions in the frame.
        """
        if self.bone not in bones:
            return self
        turn = bones[self.bone].rotation
        return replace(self, distal=turn @ self.distal, dorsal=turn @ self.dorsal, radial=turn @ self.radial)


@dataclass(frozen=True)
class _Ray:
    """A finger: its bones from the metacarpal to the tip, and its own directions at the knuckle."""

    bones: tuple[str, ...]
    knuckle: Array
    distal: Array
    dorsal: Array


def hand_directions(rig: JointTree, hand: Literal["right", "left"]) -> HandDirections | None:
    """Directions of a hand in neutral by its fingers' knuckles, where positive flexion bends to the palm.

    Each finger's metacarpal points distally, and dorsal is distal x axis of flexion, on either hand. Where
    one bone carries several fingers, distal is perpendicular to the axis. Fingers that disagree with most of
    them, such as a thumb, do not count.

    Parameters
    ----------
    rig : JointTree
        Joints and neutral bones of the subject.
    hand : str
        "right" or "left": on which side the thumb is.

    Returns
    -------
    HandDirections or None
        Directions in the neutral frame; None where no joint of the rig tells them: none moves, or those that
        move are ball joints without a flexion.
    """
    rays = _fingers(rig)
    if not rays:
        return None
    distal, dorsal = _orthogonal(rays)
    across = np.cross(dorsal, distal)
    return HandDirections(distal, dorsal, across if hand == "right" else -across, middle_finger(rig)[0])


def middle_finger(rig: JointTree) -> tuple[str, ...]:
    """Bones from metacarpal to tip of the finger that is amid the fingers.

    Parameters
    ----------
    rig : JointTree
        Joints and neutral bones of the subject. Of other limbs, the middle one of their toes.

    Returns
    -------
    tuple of str
        Names of the bones; without a joint that moves, the longest chain from the root.
    """
    rays = _fingers(rig)
    if not rays:
        chains = [(rig.root,), *(_bones_of(chain, rig) for chain in _chains(rig))]
        return max(chains, key=lambda bones: len(bones))
    distal, dorsal = _orthogonal(rays)
    across = np.cross(dorsal, distal)
    beside = sorted(rays, key=lambda ray: float(ray.knuckle @ across))
    amid = beside[(len(beside) - 1) // 2 : len(beside) // 2 + 1]  # two of four, of which one reaches farther
    return max(amid, key=lambda ray: float(ray.knuckle @ distal)).bones


def _fingers(rig: JointTree) -> list[_Ray]:
    """Rays whose directions agree with those of most others."""
    found = [_ray(chain, rig) for chain in _chains(rig) if any(map(_tells, chain))]
    if not found:
        return []
    # Of rays that agree with equally many, one with two hinges is a finger rather than a thumb.
    found.sort(key=lambda ray: -len(ray.bones))
    alike = np.array([[min(a.distal @ b.distal, a.dorsal @ b.dorsal) for b in found] for a in found])
    chosen = int(np.argmax(alike.sum(axis=1)))
    return [ray for ray, cosine in zip(found, alike[chosen], strict=True) if cosine >= AGREE]


def _orthogonal(rays: list[_Ray]) -> tuple[Array, Array]:
    distal = _unit(np.sum([ray.distal for ray in rays], axis=0))
    dorsal = np.sum([ray.dorsal for ray in rays], axis=0)
    return distal, _unit(dorsal - (dorsal @ distal) * distal)


def _chains(rig: JointTree) -> list[list[RigJoint]]:
    """The joints from the root to each tip."""
    of = {joint.child: joint for joint in rig.joints}
    tips = set(of) - {joint.parent for joint in rig.joints}
    chains = []
    for tip in (j.child for j in rig.joints if j.child in tips):
        chain = [of[tip]]
        while chain[-1].parent in of:
            chain.append(of[chain[-1].parent])
        chains.append(chain[::-1])
    return chains


def _bones_of(chain: list[RigJoint], rig: JointTree) -> tuple[str, ...]:
    return (chain[0].parent, *(joint.child for joint in chain)) if chain else (rig.root,)


def _tells(joint: RigJoint) -> bool:
    """Whether a joint has a flexion: a ball joint's axes are any three, unless one is named so."""
    return 0 < len(joint.angles) < BALL or any(name.endswith("flexion") for name in joint.angles)


def _ray(chain: list[RigJoint], rig: JointTree) -> _Ray:
    moving = [i for i, joint in enumerate(chain) if _tells(joint)]
    first = moving[-MOVING] if len(moving) >= MOVING else moving[0]
    joint = chain[first]
    distal = joint.fit.centre - rig.surfaces[joint.parent].vertices.mean(axis=0)
    flexion = next((i for i, name in enumerate(joint.angles) if name.endswith("flexion")), 0)
    axis = joint.fit.axes.directions[flexion]
    if sum(bool(j.angles) and j.parent == joint.parent for j in rig.joints) > 1:
        distal = distal - (distal @ axis) * axis  # one bone carries several fingers: it points along none
    distal = _unit(distal)
    return _Ray(_bones_of(chain[first:], rig), joint.fit.centre, distal, _unit(np.cross(distal, axis)))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))
