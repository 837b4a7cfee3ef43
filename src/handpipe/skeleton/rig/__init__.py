"""The bone rig: joint angles to the transforms of all bones and back, and how well it explains poses."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.rig.anatomical_directions import HandDirections, hand_directions, middle_finger
    from handpipe.skeleton.rig.pivots import pivoted
    from handpipe.skeleton.rig.rig import ANY_ANGLE, Rig, joint_point
    from handpipe.skeleton.rig.stated import StatedJoint, stated_rig
    from handpipe.skeleton.rig.table import joint_table
else:
    __getattr__ = face(__name__)

__all__ = [
    "ANY_ANGLE",
    "HandDirections",
    "Rig",
    "StatedJoint",
    "hand_directions",
    "joint_point",
    "joint_table",
    "middle_finger",
    "pivoted",
    "stated_rig",
]
