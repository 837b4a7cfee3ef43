"""The skin over the joints that tendons pass: where it is, and in which scanned pose it is bent most."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray
from handpipe.skeleton.rig import Rig
from handpipe.tissues.fat import Skin

AROUND = 12.0  # mm from the place of skin over a joint, in neutral


@dataclass(frozen=True)
class Knuckle:
    """The skin over a joint.

    Parameters
    ----------
    joint : str
        Name of the joint.
    pose : str
        Scanned pose that bends it most.
    vertex : int
        Vertex of the skin above the joint's centre, on the dorsal side.
    near : array (k,) of bool
        Vertices of the skin around it.
    axis : array (3,)
        Axis of flexion in neutral, a unit vector.
    """

    joint: str
    pose: str
    vertex: int
    near: BoolArray
    axis: Array


def knuckles(rig: Rig, skin: Skin, poses: Sequence[str], tendons: Iterable[Sequence[str]]) -> list[Knuckle]:
    """The knuckles of the joints that a tendon passes, given by the bones of each.

    Dorsal is distal x axis of flexion, as for `hand_directions`. Over an unbent joint there is no knuckle.
    """
    passed = [set(bones) for bones in tendons]
    found = []
    for joint in rig.joints:
        if not joint.angles or not any({joint.parent, joint.child} <= bones for bones in passed):
            continue
        centre, axis = joint.fit.centre, joint.fit.axes.directions[0]
        distal = rig.surfaces[joint.child].vertices.mean(axis=0) - centre
        dorsal = np.cross(distal, axis)
        dorsal /= np.linalg.norm(dorsal)
        offsets = skin.surface.vertices - centre
        beside = np.linalg.norm(offsets - np.outer(offsets @ dorsal, dorsal), axis=1)
        vertex = int(np.argmin(np.where(offsets @ dorsal > 0, beside, np.inf)))
        near = np.linalg.norm(skin.surface.vertices - skin.surface.vertices[vertex], axis=1) < AROUND
        moved = {pose: rig.scanned_bones(pose) for pose in poses}
        bend = {pose: bones[joint.parent].angle_to(bones[joint.child]) for pose, bones in moved.items()}
        found.append(Knuckle(joint.name, max(bend, key=lambda p: bend[p]), vertex, near, axis))
    return found
