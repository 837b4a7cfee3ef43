"""A rig whose joints are stated: no pose was scanned."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.core.configuration import joint_order
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.joint_tree import FittedPose, RigJoint
from handpipe.skeleton.joints.joints import fit_joint
from handpipe.skeleton.rig.rig import Rig


class StatedJoint(NamedTuple):
    """A joint with fixed axes through one centre; without angles its bones move as one.

    Parameters
    ----------
    name : str
        Name of the joint.
    parent, child : str
        Bones that it connects.
    angles : tuple of str
        Names of its k angles.
    limits : array (k, 2)
        Lower and upper limit of each angle in rad.
    axes : array (k, 3)
        Unit vectors.
    centre : array (3,)
        Centre of rotation in mm.
    """

    name: str
    parent: str
    child: str
    angles: tuple[str, ...] = ()
    limits: Array = np.zeros((0, 2))
    axes: Array = np.zeros((0, 3))
    centre: Array = np.zeros(3)


def stated_rig(
    joints: Sequence[StatedJoint], surfaces: Mapping[str, Surface], poses: Mapping[str, Angles] | None = None
) -> Rig:
    """A rig of stated joints.

    Parameters
    ----------
    joints : sequence of StatedJoint
        Joints in any order.
    surfaces : mapping of str to Surface
        Neutral bone surfaces, mm.
    poses : mapping of str to mapping of str to float, optional
        Angles in rad of poses by name, which the rig keeps as if they had been scanned.

    Returns
    -------
    Rig
        Its root is the bone that no joint moves.
    """
    children = {joint.child for joint in joints}
    root = next(bone for bone in surfaces if bone not in children)
    named = {joint.name: joint for joint in joints}
    order = joint_order({name: (joint.parent, joint.child) for name, joint in named.items()})
    known = {
        name: FittedPose(RigidTransform.identity(), dict(angles)) for name, angles in (poses or {}).items()
    }
    return Rig(root, tuple(_rig_joint(named[name]) for name in order), dict(surfaces), known)


def _rig_joint(joint: StatedJoint) -> RigJoint:
    fit = fit_joint([], len(joint.angles), joint.axes, near=joint.centre)
    return RigJoint(joint.name, joint.parent, joint.child, joint.angles, joint.limits, fit)
