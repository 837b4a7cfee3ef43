"""Bones in new poses: inverse kinematics, validity, pose spaces, skinning, the layer of bones."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.posing.collisions import Collision, collisions_of
    from handpipe.skeleton.posing.joint_sweep import FACING, OPPOSED, swept_vertices
    from handpipe.skeleton.posing.layer import BoneLayer, bone_regions
    from handpipe.skeleton.posing.left_out import left_out_weights, prediction_variance
    from handpipe.skeleton.posing.local_pose_spaces import LocalPoseSpaces
    from handpipe.skeleton.posing.pose_space import Interpolation, PoseSpace
    from handpipe.skeleton.posing.skinning import (
        blend,
        blend_linearly,
        blended,
        bone_weights,
        smoothed_weights,
    )
    from handpipe.skeleton.posing.validity import PoseValidity, validity_table
else:
    __getattr__ = face(__name__)

__all__ = [
    "FACING",
    "OPPOSED",
    "BoneLayer",
    "Collision",
    "Interpolation",
    "LocalPoseSpaces",
    "PoseSpace",
    "PoseValidity",
    "blend",
    "blend_linearly",
    "blended",
    "bone_regions",
    "bone_weights",
    "collisions_of",
    "left_out_weights",
    "prediction_variance",
    "smoothed_weights",
    "swept_vertices",
    "validity_table",
]
