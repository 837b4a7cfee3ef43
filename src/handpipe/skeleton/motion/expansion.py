"""The frames of a motion from the file that describes it, told by suffix and header."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from handpipe.core import InputError
from handpipe.core.configuration import Recording
from handpipe.skeleton.drivers.landmarks import Hand
from handpipe.skeleton.joints.angles import Limits
from handpipe.skeleton.motion.contraction_motion import (
    is_contraction_table,
    read_contraction_motion,
    read_contractions,
)
from handpipe.skeleton.motion.interpolation import angles_between
from handpipe.skeleton.motion.keyframes import is_keyframe_table, read_keyframes
from handpipe.skeleton.motion.motion import Motion
from handpipe.skeleton.motion.random_poses import is_random_file, random_names, read_random_poses
from handpipe.skeleton.motion.target_file import read_targets
from handpipe.skeleton.motion.target_motion import read_target_motion
from handpipe.skeleton.motion.tracked_motion import read_tracked_motion
from handpipe.skeleton.motion.tracks import frame_times, is_track_table, read_track
from handpipe.skeleton.rig.rig import Rig


def is_motion(path: str | Path) -> bool:
    """Whether a file describes a motion: keyframes, targets, random poses, contractions or tracked points.

    Parameters
    ----------
    path : str or Path
        File of a scene's frames.

    Returns
    -------
    bool
    """
    return _kind(path) is not None


def motion_frame_names(
    path: str | Path,
    limits: Limits,
    bones: Sequence[str] = (),
    hand: Hand = "right",
    recording: Recording | None = None,
) -> list[str]:
    """Names of the frames of a motion, known without a rig.

    Parameters
    ----------
    path : str or Path
        Keyframes, targets, random poses, contractions or tracked points.
    limits : mapping of str to (float, float)
        Lower and upper limit of every angle in rad.
    bones : sequence of str, optional
        Bones of the rig, against which targets are checked.
    hand : str
        "right" or "left": the hand of the subject.
    recording : Recording, optional
        Which part of tracked points.

    Returns
    -------
    list of str
        Names in the order of time.

    Raises
    ------
    InputError
        If the file is wrong, or describes no motion.
    """
    kind = _kind(path)
    _require_tracks(path, kind, recording)
    if kind == "keyframes":
        return read_keyframes(path, limits).times.frame_names
    if kind == "targets":
        return read_targets(path, limits, tuple(bones))[1].frame_names
    if kind == "contractions":
        return read_contractions(path).times.frame_names
    if kind == "random":
        return random_names(path)
    chosen = _recording(path, kind, recording)
    return list(frame_times(path, read_track(path, chosen.side or hand), chosen))


def expand_motion(
    path: str | Path, rig: Rig, *, hand: Hand = "right", recording: Recording | None = None
) -> Motion:
    """Angles of the frames of a motion.

    Parameters
    ----------
    path : str or Path
        Keyframes or contractions (CSV), targets of inverse kinematics or random poses (YAML), or tracked
        points (CSV).
    rig : Rig
        Rig that the motion moves.
    hand : str
        "right" or "left": the hand that the rig is of. Tracked points of the other hand are mirrored.
    recording : Recording, optional
        Which part of tracked points, and their filter.

    Returns
    -------
    Motion
        Angles in rad within their limits by frame, figures of frames, and what was not reached or bridged.

    Raises
    ------
    InputError
        If the file is wrong, describes no motion, or does not suit the rig.
    """
    kind = _kind(path)
    _require_tracks(path, kind, recording)
    if kind == "keyframes":
        keys = read_keyframes(path, rig.limits, {name: pose.angles for name, pose in rig.poses.items()})
        frames = angles_between(keys.times.times, keys.angles, rig.angle_names, keys.times.frames)
        return Motion(dict(zip(keys.times.frame_names, frames, strict=True)))
    if kind == "targets":
        return read_target_motion(path, rig)
    if kind == "contractions":
        return read_contraction_motion(path, rig)
    if kind == "random":
        return read_random_poses(path, rig)
    return read_tracked_motion(path, rig, hand, _recording(path, kind, recording))


def _kind(path: str | Path) -> str | None:
    if Path(path).suffix.lower() in (".yaml", ".yml"):
        return "random" if is_random_file(path) else "targets"
    if is_keyframe_table(path):
        return "keyframes"
    if is_contraction_table(path):
        return "contractions"
    return "track" if is_track_table(path) else None


def _require_tracks(path: str | Path, kind: str | None, recording: Recording | None) -> None:
    if recording is not None and kind != "track":
        problem = "is given, but the file of frames holds no tracked points"
        remedy = "Remove the field, or name a recording of tracked points under frames"
        raise InputError(path, "recording", problem, remedy)


def _recording(path: str | Path, kind: str | None, recording: Recording | None) -> Recording:
    """What a scene says of tracked points; raises `InputError` for a file that holds none."""
    if kind is None:
        remedy = (
            "Give a table whose first column is `key` or `contraction`, targets as .yaml, or tracked points"
        )
        problem = "holds no keyframes, targets, contractions or tracked points"
        raise InputError(path, "frames", problem, remedy)
    return recording or Recording.model_validate({})
