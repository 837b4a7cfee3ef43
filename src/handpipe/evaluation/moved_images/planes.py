"""Planes through a posed hand whose directions are those of its bones and joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import Array, Frame, RigidTransform, Shapes
from handpipe.evaluation.slices import Plane, sagittal_plane, transversal_plane
from handpipe.skeleton.rig import Rig


def anatomical_planes(rig: Rig, frame: Frame, layers: Mapping[str, Shapes]) -> dict[str, Plane]:
    """Sagittal, coronal and two transversal planes through the middle finger of a frame.

    The sagittal plane goes through the centroids of the finger's last four bones. The coronal one goes along
    the first of them, the metacarpal, and contains the axis of flexion. Of other limbs, the longest chain of
    bones takes the finger's place.

    Parameters
    ----------
    rig : Rig
        Joints of the subject.
    frame : Frame
        The frame, with the bones' transforms.
    layers : mapping of str to Shapes
        Its shapes by layer and body.

    Returns
    -------
    dict of str to Plane
        Planes in mm by name, the root bone at rest. Distal points to the right, and dorsal upwards in
        sagittal and transversal ones.
    """
    bones = layers["bones"]
    chain = [bone for bone in _middle_chain(rig) if bone in bones]
    if len(chain) < 2:
        return {f"transversal, {b}": transversal_plane(bones[b].vertices, np.eye(3)[2]) for b in chain}
    middles = np.array([bones[bone].vertices.mean(axis=0) for bone in chain])
    first = max(len(chain) - 4, 0)  # of a finger: its metacarpal
    axis = _flexion_axis(rig, chain, frame.bones)
    still = [bones[bone].rest.mean(axis=0) for bone in chain[first : first + 2]]
    along = frame.bones[chain[first]].rotation @ (still[1] - still[0])  # does not turn with the next joint
    up = np.cross(along, axis)
    planes = {"sagittal": sagittal_plane(middles[first:], -axis, along)}
    planes["coronal"] = Plane(middles[first], *_frame_of(along, axis))
    for bone in chain[first : first + 2]:
        planes[f"transversal, {bone}"] = transversal_plane(bones[bone].vertices, up)
    return planes


def _frame_of(along: Array, axis: Array) -> tuple[Array, Array]:
    """Unit vectors to the right, along, and upwards, the axis as far as it is perpendicular."""
    right = along / np.linalg.norm(along)
    across = axis - right * float(axis @ right)
    return right, across / np.linalg.norm(across)


def _middle_chain(rig: Rig) -> list[str]:
    """Bones from the root to the tip of the middle one of the longest branches."""
    parents = rig.parents
    chains = []
    for bone in rig.bones:
        if bone not in parents.values():
            chain = [bone]
            while chain[-1] in parents:
                chain.append(parents[chain[-1]])
            chains.append(chain[::-1])
    longest = max(map(len, chains))
    equal = [chain for chain in chains if len(chain) == longest]
    return equal[(len(equal) - 1) // 2]


def _flexion_axis(rig: Rig, chain: list[str], moved: Mapping[str, RigidTransform]) -> Array:
    """Mean axis of the chain's hinges in the frame, else the first axis of its last joint that has one."""
    joints = [j for j in rig.joints if j.child in chain and len(j.angles)]
    hinges = [j for j in joints if len(j.angles) == 1] or joints[-1:]
    if not hinges:
        return np.array([0.0, 1.0, 0.0])
    axes = [moved[j.parent].rotation @ j.fit.axes.directions[0] for j in hinges]
    mean = np.mean(axes, axis=0)
    return np.asarray(mean / np.linalg.norm(mean), dtype=np.float64)
