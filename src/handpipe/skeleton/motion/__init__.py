"""Motions: keyframes, targets of inverse kinematics, contractions, tracked points; each becomes angles."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.motion.contraction_motion import write_contractions
    from handpipe.skeleton.motion.expansion import expand_motion, is_motion, motion_frame_names
    from handpipe.skeleton.motion.motion import Motion
    from handpipe.skeleton.motion.random_poses import (
        RandomPoses,
        draw_poses,
        is_random_file,
        read_random_file,
    )
    from handpipe.skeleton.motion.times import RATE
else:
    __getattr__ = face(__name__)

__all__ = [
    "RATE",
    "Motion",
    "RandomPoses",
    "draw_poses",
    "expand_motion",
    "is_motion",
    "is_random_file",
    "motion_frame_names",
    "read_random_file",
    "write_contractions",
]
