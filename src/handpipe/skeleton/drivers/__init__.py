"""Frames of a scene from what drives it: tables of angles, motion capture, landmarks."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.drivers.landmark_motion import LandmarkMap, landmark_map
    from handpipe.skeleton.drivers.landmarks import LANDMARKS
    from handpipe.skeleton.drivers.scene_frames import frame_names, read_frames
    from handpipe.skeleton.joints.angles import write_angles
else:
    __getattr__ = face(__name__)

__all__ = ["LANDMARKS", "LandmarkMap", "frame_names", "landmark_map", "read_frames", "write_angles"]
