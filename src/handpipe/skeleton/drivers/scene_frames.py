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
    """Names of the frames in a file, known without a rig.

    Parameters
    ----------
    path : str or Path
        Table of joint angles, BVH file, or landmarks as JSON or CSV.
    limits : mapping of str to (float, float)
        Lower and upper limit of every angle in rad.
    bones : sequence of str, optional
        Bones of the rig, the root first; a BVH file's joints are checked against them.
    joints : mapping of str to str, optional
        Joint in the BVH file by bone, where their names differ.

    Returns
    -------
    list of str
        Names in the order of the file.

    Raises
    ------
    InputError
        If the file itself is wrong, which includes joint angles beyond limits.
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
    """Joint angles of the frames in a file.

    Parameters
    ----------
    path : str or Path
        Table of joint angles, BVH file, or landmarks as JSON or CSV.
    rig : Rig
        Rig that the frames move.
    hand : str
        "right" or "left": the hand that the rig is of. Landmarks of the other hand are mirrored.
    bones : mapping of str to str, optional
        Joint in the BVH file by bone of the rig, where their names differ.

    Returns
    -------
    dict of str to dict of str to float
        Angles in rad within their limits, by frame and angle name, in the order of the file.

    Raises
    ------
    InputError
        If the file is wrong, or does not suit the rig.
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
