"""Bone transforms in between: screw motions from neutral to a pose, seen from a base bone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform

Bones = Mapping[str, RigidTransform]


def relative_to(bones: Bones, base: str) -> dict[str, RigidTransform]:
    """Transforms from neutral as seen from a base bone, whose own becomes the identity."""
    back = bones[base].inverse()
    return {name: back @ transform for name, transform in bones.items()}


def _screw_translation(turn: Array) -> Array:
    """Matrix (3, 3) that takes a screw motion's velocity to its translation, for a rotation vector."""
    angle = float(np.linalg.norm(turn))
    k = np.cross(turn, np.eye(3)).T  # k @ v is turn x v
    if angle < 1e-6:
        return np.eye(3) + 0.5 * k
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * k + (angle - np.sin(angle)) / angle**3 * k @ k


def screw(transform: RigidTransform, share: float) -> RigidTransform:
    """A share of a rigid motion along its screw axis: 0 is the identity, 1 the motion itself."""
    turn = transform.rotation_vector()
    velocity = np.linalg.solve(_screw_translation(turn), transform.translation)
    rotation = Rotation.from_rotvec(share * turn).as_matrix()
    return RigidTransform(rotation, _screw_translation(share * turn) @ (share * velocity))


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
