"""Bones on their way from one pose to another: each turns by a screw relative to its parent."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import RigidTransform, left_jacobian


def partway(
    origin: Mapping[str, RigidTransform],
    bones: Mapping[str, RigidTransform],
    parents: Mapping[str, str],
    share: float,
) -> dict[str, RigidTransform]:
    """Bones at a share of their way from one pose to another.

    Each bone goes on a screw relative to its parent, so that joints stay together.

    Parameters
    ----------
    origin, bones : mapping of str to RigidTransform
        Transforms of the bones in the first and in the last pose.
    parents : mapping of str to str
        Parent of each bone but the root, parents before children.
    share : float
        Share of the way, in 0..1.

    Returns
    -------
    dict of str to RigidTransform
        Transforms there.
    """
    found = {
        name: origin[name] @ part_of(origin[name].inverse() @ bone, share)
        for name, bone in bones.items()
        if name not in parents
    }
    for child, parent in parents.items():
        first, last = (pose[parent].inverse() @ pose[child] for pose in (origin, bones))
        found[child] = found[parent] @ first @ part_of(first.inverse() @ last, share)
    return found


def part_of(transform: RigidTransform, share: float) -> RigidTransform:
    """A share of the screw that a transform is."""
    vector = transform.rotation_vector()
    along = np.linalg.solve(left_jacobian(vector), transform.translation)
    turned = Rotation.from_rotvec(share * vector).as_matrix()
    return RigidTransform(turned, left_jacobian(share * vector) @ (share * along))


def turn(
    origin: Mapping[str, RigidTransform], bones: Mapping[str, RigidTransform], child: str, parent: str
) -> float:
    """Angle in rad by which a bone turns relative to another, from `origin`."""
    first, last = (pose[parent].inverse() @ pose[child] for pose in (origin, bones))
    return first.angle_to(last)
