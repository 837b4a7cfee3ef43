"""Bone transforms in between: screw motions from neutral to a pose, seen from a base bone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import expm, logm

from handpipe.mesh.rigid import RigidTransform

Bones = Mapping[str, RigidTransform]


def relative_to(bones: Bones, base: str) -> dict[str, RigidTransform]:
    """Transforms from neutral as seen from a base bone, whose own becomes the identity."""
    back = bones[base].inverse()
    return {name: back @ transform for name, transform in bones.items()}


def screw(transform: RigidTransform, share: float) -> RigidTransform:
    """A share of a rigid motion along its screw axis: 0 is the identity, 1 the motion itself."""
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = transform.rotation, transform.translation
    partial = expm(share * np.real(logm(m)))
    return RigidTransform(partial[:3, :3], partial[:3, 3])


def steps_towards(bones: Bones, chain: Sequence[str], largest_turn: float) -> list[dict[str, RigidTransform]]:
    """Poses from neutral to `bones`, by turns of at most `largest_turn` rad of a bone against the next.

    `chain` names bones from the tip to the base, which is at rest. Each turns about a fixed axis of the next
    one's frame, as its joint does: turning all of them about axes of the base would pull the joints apart.
    """
    joints = {a: bones[b].inverse() @ bones[a] for a, b in zip(chain[:-1], chain[1:], strict=True)}
    turn = max([float(np.linalg.norm(t.rotation_vector())) for t in joints.values()], default=0.0)
    count = max(int(np.ceil(turn / largest_turn)), 1)
    poses = []
    for share in (np.arange(count) + 1) / count:
        pose = {chain[-1]: bones[chain[-1]]}
        for a, b in reversed(list(zip(chain[:-1], chain[1:], strict=True))):
            pose[a] = pose[b] @ screw(joints[a], share)
        poses.append(pose)
    return poses
