"""How fast every bone moves with every joint angle: the analytic Jacobian of the rig's full model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.skeleton.joints.joint_tree import JointTree
from handpipe.skeleton.joints.joints import Model


@dataclass(frozen=True)
class MovingBone:
    """A bone's transform from neutral, and its twists for a unit rate of each of the rig's angles.

    A point of the bone at x moves with angular x x + linear (cross product).

    Parameters
    ----------
    transform : RigidTransform
        Transform from neutral, mm.
    angular : array (n, 3)
        Angular velocities, without unit (rad per rad), in the order of `angle_names`.
    linear : array (n, 3)
        Velocities at the origin in mm per rad.
    """

    transform: RigidTransform
    angular: Array
    linear: Array

    def velocities(self, point: Array) -> Array:
        """Derivatives (n, 3) in mm per rad of where a neutral point (3,) of the bone goes."""
        return np.cross(self.angular, self.transform(point)) + self.linear


def moving_bones(
    rig: JointTree, angles: Mapping[str, float], root: RigidTransform | None = None, model: Model = "full"
) -> dict[str, MovingBone]:
    """Bones at the given angles in rad with their twists; `root` and `model` as in `bone_transforms`.

    A child has its parent's twists and those of its own joint, carried by the parent's transform.
    """
    names = {name: i for i, name in enumerate(rig.angle_names)}
    still = np.zeros((len(names), 3))
    bones = {rig.root: MovingBone(root or RigidTransform.identity(), still, still)}
    for joint in rig.joints:
        values = np.array([angles[n] for n in joint.angles])
        parent, rows = bones[joint.parent], [names[n] for n in joint.angles]
        angular, linear = parent.angular.copy(), parent.linear.copy()
        own_angular, own_linear = joint.fit.twists(values, model)
        turn = parent.transform.rotation
        angular[rows] = own_angular @ turn.T
        linear[rows] = own_linear @ turn.T + np.cross(parent.transform.translation, angular[rows])
        transform = parent.transform @ joint.fit.transform(values, model)
        bones[joint.child] = MovingBone(transform, angular, linear)
    return bones
