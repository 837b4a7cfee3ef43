"""Frames of a scene from what drives it: tables of angles, motion capture, landmarks."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.drivers.landmark_motion import LANDMARK_NUMBERS, LandmarkMap, landmark_map
    from handpipe.skeleton.drivers.landmarks import LANDMARKS
    from handpipe.skeleton.drivers.scene_frames import frame_names, read_frames
    from handpipe.skeleton.joints.angles import write_angles
else:
    __getattr__ = face(__name__)

__all__ = [
    "LANDMARKS",
    "LANDMARK_NUMBERS",
    "LandmarkMap",
    "frame_names",
    "landmark_map",
    "read_frames",
    "write_angles",
]
