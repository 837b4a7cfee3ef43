"""Bone transforms in between: screw motions from neutral to a pose, seen from a base bone."""

from __future__ import annotations

from collections.abc import Mapping

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


def steps_towards(bones: Bones, base: str, largest_turn: float) -> list[dict[str, RigidTransform]]:
    """Poses from neutral to `bones`, by turns of at most `largest_turn` rad against the base bone.

    Bones turn about fixed axes of the base bone's frame; the base bone itself is in its place from the start.
    """
    relative = relative_to(bones, base)
    turn = max(float(np.linalg.norm(t.rotation_vector())) for t in relative.values())
    count = max(int(np.ceil(turn / largest_turn)), 1)
    shares = (np.arange(count) + 1) / count
    poses = [{name: bones[base] @ screw(t, s) for name, t in relative.items()} for s in shares[:-1]]
    return [*poses, dict(bones)]
