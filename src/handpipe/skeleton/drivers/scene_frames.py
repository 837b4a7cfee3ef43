"""The frames of a scene from whatever file its `frames` names, told by suffix and header."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from handpipe.skeleton.drivers.bvh_motion import bvh_frame_names, read_bvh_angles
from handpipe.skeleton.drivers.landmark_motion import read_landmark_angles
from handpipe.skeleton.drivers.landmarks import Hand, is_landmark_table, read_landmarks
from handpipe.skeleton.joints.angles import Angles, Limits, read_angles
from handpipe.skeleton.rig.rig import Rig


def frame_names(
    path: str | Path, limits: Limits, bones: Sequence[str] = (), joints: Mapping[str, str] | None = None
) -> list[str]:
    """Names of the frames, in file order, known without a rig.

    bones: the rig's, its root first, and joints: a bone's joint in a BVH file, for the check of their names.
    Raises `InputError` for all that is wrong with the file itself: joint angles beyond limits (rad) too.
    """
    kind = _kind(path)
    if kind == "bvh":
        return bvh_frame_names(path, bones, joints)
    if kind == "landmarks":
        return list(read_landmarks(path).names)
    return list(read_angles(path, limits))


def read_frames(
    path: str | Path, rig: Rig, *, hand: Hand = "right", bones: Mapping[str, str] | None = None
) -> dict[str, Angles]:
    """Frame name -> angle name -> rad, within limits, in file order.

    hand: which hand the rig is of; bones: the rig's bone -> its joint's name in a BVH file, where they
    differ. Raises `InputError` for a wrong file, and for one that does not suit the rig.
    """
    kind = _kind(path)
    if kind == "bvh":
        return read_bvh_angles(path, rig, bones)
    if kind == "landmarks":
        return read_landmark_angles(path, rig, hand)
    return read_angles(path, rig.limits)


def _kind(path: str | Path) -> str:
    suffix = Path(path).suffix.lower()
    if suffix == ".bvh":
        return "bvh"
    return "landmarks" if suffix == ".json" or is_landmark_table(path) else "angles"
