"""The rig as lines from joint to joint, as motion capture sees a hand."""

from __future__ import annotations

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.rig.rig import Rig

TIP = 0.99  # quantile of the distances from a bone's joint: beyond is its tip


def joint_places(rig: Rig) -> dict[str, Array]:
    """Where each bone's joint to its parent (3,) is in neutral, in mm; the root bone has none."""
    return {joint.child: joint.fit.centre for joint in rig.joints}


def bone_tips(rig: Rig) -> dict[str, Array]:
    """Far ends (3,) in neutral of bones that carry no other bone, in mm.

    The far end is the mean of the hundredth of the vertices that is farthest from the joint.
    """
    parents = {joint.parent for joint in rig.joints}
    tips = {}
    for bone, place in joint_places(rig).items():
        if bone not in parents:
            vertices = rig.surfaces[bone].vertices
            distances = np.linalg.norm(vertices - place, axis=1)
            tips[bone] = vertices[distances >= np.quantile(distances, TIP)].mean(axis=0)
    return tips


def bone_lines(rig: Rig) -> dict[str, tuple[Array, Array]]:
    """Ends (3,), (3,) in neutral of bones that are one line: from their joint to the next, or to the tip."""
    places, tips = joint_places(rig), bone_tips(rig)
    lines = {}
    for bone, place in places.items():
        after = [places[j.child] for j in rig.joints if j.parent == bone]
        if len(after) <= 1:
            lines[bone] = (place, after[0] if after else tips[bone])
    return lines
