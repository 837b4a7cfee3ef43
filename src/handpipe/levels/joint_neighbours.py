"""Which joints are near a bone, counted in joints that move."""

from __future__ import annotations

import numpy as np

from handpipe.core import IntArray
from handpipe.skeleton.rig import Rig

HOPS = (1, 2, 3)  # moving joints from a bone to a joint whose angles drive its part; then all joints


def moving_bones(rig: Rig) -> IntArray:
    """For each bone the number of the first bone that it moves as one with."""
    found = {rig.root: 0}
    for number, joint in enumerate(rig.joints, start=1):
        found[joint.child] = number if joint.angles else found[joint.parent]
    return np.array([found[bone] for bone in rig.bones])


def driving_angles(rig: Rig) -> dict[int, list[tuple[int, ...]]]:
    """By the number of each bone that moves: numbers of the angles that may drive it, the fewest first."""
    bones, moving = rig.bones, moving_bones(rig)
    steps = np.full((len(bones), len(bones)), np.inf)
    np.fill_diagonal(steps, 0.0)
    for number, joint in enumerate(rig.joints, start=1):
        above = bones.index(joint.parent)
        steps[number, :number] = steps[above, :number] + bool(joint.angles)
        steps[:number, number] = steps[number, :number]
    owners = [number for number, joint in enumerate(rig.joints, start=1) for _ in joint.angles]
    carriers = [bones.index(joint.parent) for joint in rig.joints for _ in joint.angles]
    away = 1 + np.minimum(steps[:, owners], steps[:, carriers])
    every = tuple(range(len(owners)))
    return {
        int(bone): [
            *(near for hops in HOPS if (near := tuple(np.flatnonzero(away[bone] <= hops).tolist()))),
            every,
        ]
        for bone in np.unique(moving)
    }
