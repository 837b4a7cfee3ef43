"""Planes through a posed hand whose directions are those of its bones and joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handpipe.core import Array, Frame, RigidTransform, Shapes
from handpipe.evaluation.slices import Plane, sagittal_plane, transversal_plane
from handpipe.skeleton.rig import Rig, middle_finger


def anatomical_planes(rig: Rig, frame: Frame, layers: Mapping[str, Shapes]) -> dict[str, Plane]:
    """Sagittal, coronal and two transversal planes through the middle finger of a frame.

    The sagittal plane goes through the centroids of the finger's bones. The coronal one goes along the first
    of them, the metacarpal, and contains the axis of flexion. Where no joint moves, the longest chain of
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
    chain = [bone for bone in middle_finger(rig) if bone in bones]
    if len(chain) < 2:
        return {f"transversal, {b}": transversal_plane(bones[b].vertices, np.eye(3)[2]) for b in chain}
    middles = np.array([bones[bone].vertices.mean(axis=0) for bone in chain])
    axis = _flexion_axis(rig, chain, frame.bones)
    still = [bones[bone].rest.mean(axis=0) for bone in chain[:2]]
    along = frame.bones[chain[0]].rotation @ (still[1] - still[0])  # does not turn with the next joint
    up = np.cross(along, axis)
    planes = {"sagittal": sagittal_plane(middles, -axis, along)}
    planes["coronal"] = Plane(middles[0], *_frame_of(along, axis))
    for bone in chain[:2]:
        planes[f"transversal, {bone}"] = transversal_plane(bones[bone].vertices, up)
    return planes


def _frame_of(along: Array, axis: Array) -> tuple[Array, Array]:
    """Unit vectors to the right, along, and upwards, the axis as far as it is perpendicular."""
    right = along / np.linalg.norm(along)
    across = axis - right * float(axis @ right)
    return right, across / np.linalg.norm(across)


def _flexion_axis(rig: Rig, chain: list[str], moved: Mapping[str, RigidTransform]) -> Array:
    """Mean axis of the chain's hinges in the frame, else the first axis of its last joint that has one."""
    joints = [j for j in rig.joints if j.child in chain[1:] and len(j.angles)]
    hinges = [j for j in joints if len(j.angles) == 1] or joints[-1:]
    if not hinges:
        return np.array([0.0, 1.0, 0.0])
    axes = [moved[j.parent].rotation @ j.fit.axes.directions[0] for j in hinges]
    mean = np.mean(axes, axis=0)
    return np.asarray(mean / np.linalg.norm(mean), dtype=np.float64)
