"""Motions: keyframes, targets of inverse kinematics, tracked points; each becomes angles of frames."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.motion.expansion import expand_motion, is_motion, motion_frame_names
    from handpipe.skeleton.motion.motion import Motion
else:
    __getattr__ = face(__name__)

__all__ = ["Motion", "expand_motion", "is_motion", "motion_frame_names"]
