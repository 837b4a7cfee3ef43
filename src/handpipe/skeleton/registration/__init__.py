"""Rigid registration of the neutral bones to a pose, and which registrations to doubt."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.registration.image_refinement import PoseImages
    from handpipe.skeleton.registration.neutral_bones import neutral_doubts
    from handpipe.skeleton.registration.odd_bones import without_odd_bones
    from handpipe.skeleton.registration.pose_registration import register_pose, unmoved
    from handpipe.skeleton.registration.registration import register
    from handpipe.skeleton.registration.registration_table import registration_figures, registration_rows
else:
    __getattr__ = face(__name__)

__all__ = [
    "PoseImages",
    "neutral_doubts",
    "register",
    "register_pose",
    "registration_figures",
    "registration_rows",
    "unmoved",
    "without_odd_bones",
]
