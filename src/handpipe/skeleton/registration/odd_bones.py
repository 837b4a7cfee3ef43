"""Bones whose motion in one pose disagrees with all other poses: an undetected wrong registration.

A phalanx that was registered turned about its long axis fits its image nearly as well. The joint's axes, as
the other poses show them, cannot explain it.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.core.configuration import Dataset
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.bones.bodies import moved_as_one
from handpipe.skeleton.joints.axes import fit_axes
from handpipe.skeleton.joints.joints import leftover
from handpipe.skeleton.registration.doubts import blame

Bones = Mapping[str, RigidTransform]
LOG = logging.getLogger(__name__)

ODD = np.radians(10.0)  # off axes that the other poses agree on
BY_OTHERS = 4.0  # times what these axes leave of the other poses
USUAL = np.radians(1.0)  # what axes leave of good poses, at least


def without_odd_bones(
    dataset: Dataset,
    transforms: Mapping[str, Bones],
    surfaces: Mapping[str, Surface],
    fit_poses: Sequence[str],
) -> tuple[dict[str, dict[str, RigidTransform]], dict[tuple[str, str], str]]:
    """Transforms without bones whose motion disagrees with the other poses.

    Poses that are not fitted are judged by those that are.

    Parameters
    ----------
    dataset : Dataset
        Dataset with the joints.
    transforms : mapping of str to mapping of str to RigidTransform
        Transforms from neutral by pose and bone.
    surfaces : mapping of str to Surface
        Neutral surfaces in mm by bone.
    fit_poses : sequence of str
        Poses that the rig is fitted to.

    Returns
    -------
    left : dict of str to dict of str to RigidTransform
        The remaining transforms by pose and bone.
    reasons : dict of (str, str) to str
        Why a bone is left out, by pose and bone.
    """
    merged = moved_as_one(dataset, transforms, surfaces)
    learnt = [p for p in fit_poses if p != dataset.neutral]
    others = [p for p in transforms if p not in fit_poses and p != dataset.neutral]
    odd: dict[str, dict[str, str]] = {pose: {} for pose in transforms}
    there: dict[str, dict[str, tuple[str, str]]] = {pose: {} for pose in transforms}
    for name, joint in dataset.joints.items():
        if not 1 <= len(joint.angles) <= 2:
            continue
        rotations = {}
        for pose in (*learnt, *others):
            bones = merged[pose]
            if joint.parent in bones and joint.child in bones:
                there[pose][name] = joint.parent, joint.child
                rotations[pose] = (bones[joint.parent].inverse() @ bones[joint.child]).rotation
        telling = [pose for pose in learnt if pose in rotations]
        for pose, angle in odd_motions(rotations, telling, np.array(joint.axis_hints, float)).items():
            reason = f"its joint {name} is {np.degrees(angle):.0f} deg off the axes of the other poses"
            odd[pose][name] = reason
    reasons = {}
    left = {pose: dict(bones) for pose, bones in transforms.items()}
    for pose, joints in odd.items():
        for bone, name in blame(joints, there[pose]).items():
            reasons[pose, bone] = joints[name]
            left[pose].pop(bone, None)
            LOG.warning("%s: %s is left out: %s", pose, bone, joints[name])
    return left, reasons


def odd_motions(rotations: Mapping[str, Array], learnt: Sequence[str], hints: Array) -> dict[str, float]:
    """Angles by which odd poses are off the axes of all others.

    The worst pose is left out, one after the other, while enough poses remain to tell the axes.

    Parameters
    ----------
    rotations : mapping of str to array (3, 3)
        Rotation of the joint by pose.
    learnt : sequence of str
        Poses that may tell the axes.
    hints : array (dof, 3)
        Rough axes of the joint.

    Returns
    -------
    dict of str to float
        Angles in rad by odd pose.
    """
    kept, odd = list(learnt), {}
    while len(kept) > len(hints) + 2:
        worst, angle, rest = max(
            ((pose, *_apart(rotations, kept, pose, hints)) for pose in kept), key=lambda found: found[1]
        )
        if angle < max(ODD, BY_OTHERS * max(rest, USUAL)):
            break
        odd[worst] = angle
        kept.remove(worst)
    if len(kept) > len(hints) + 1:
        for pose in rotations:
            if pose not in learnt:
                angle, rest = _apart(rotations, kept, pose, hints)
                if angle >= max(ODD, BY_OTHERS * max(rest, USUAL)):
                    odd[pose] = angle
    return odd


def _apart(
    rotations: Mapping[str, Array], kept: Sequence[str], pose: str, hints: Array
) -> tuple[float, float]:
    """How far in rad a pose is off the axes of the other kept ones, and these root mean square."""
    others = np.array([rotations[p] for p in kept if p != pose])
    axes = fit_axes(others, hints)
    left = np.linalg.norm(leftover(axes, np.vstack([rotations[pose][None], others])), axis=1)
    return float(left[0]), float(np.sqrt((left[1:] ** 2).mean()))
