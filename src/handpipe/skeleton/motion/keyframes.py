"""Keyframes as a table of angles at times.

key,time [frame],MP2_flexion [deg],PIP2_flexion [deg]
open,0,0,0
fist,131,66,88

Times are frames, or seconds (`time [s]`, 24 frames each). A key does not give an angle whose cell is empty.
A third column `pose` may name scanned poses, whose angles a key then takes, but for those that it gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import InputError
from handpipe.skeleton.joints.angles import (
    UNIT,
    Angles,
    Limits,
    angle_columns,
    check_given_angles,
    radians_in,
)
from handpipe.skeleton.motion.key_table import TIMES, begins_with, read_key_table
from handpipe.skeleton.motion.times import KeyTimes

KEY, POSE = "key", "pose"


@dataclass(frozen=True)
class Keyframes:
    """Keys with their times, and the angles in rad that each of them gives."""

    times: KeyTimes
    angles: tuple[Angles, ...]


def is_keyframe_table(path: str | Path) -> bool:
    """Whether a table holds keyframes, by its header."""
    return begins_with(path, KEY)


def read_keyframes(path: str | Path, limits: Limits, poses: Mapping[str, Angles] | None = None) -> Keyframes:
    """Read a table of keyframes.

    Parameters
    ----------
    path : str or Path
        CSV file with angles in degrees.
    limits : mapping of str to (float, float)
        Lower and upper limit of every angle in rad.
    poses : mapping of str to Angles, optional
        Angles in rad of the scanned poses; without them, keys have no angles of poses.

    Returns
    -------
    Keyframes

    Raises
    ------
    InputError
        If an angle or a pose is unknown, times do not increase, or an angle is beyond its limits. It names
        row and column.
    """
    example = f"{KEY},{next(iter(TIMES))},{next(iter(limits), 'MP2_flexion')}{UNIT}"
    table = read_key_table(path, example)
    first = 1 if table.columns[:1] == [POSE] else 0  # column of angles
    columns = angle_columns(path, table.columns[first:], limits, f"The angles are {', '.join(limits)}")
    angles = []
    for where, row in zip(table.places, table.cells, strict=True):
        given = {
            name: radians_in(path, where, name, cell, table.decimal_comma)
            for name, cell in zip(columns, row[first:], strict=True)
            if cell.strip()
        }
        check_given_angles(given, limits, path, where)
        named = row[0].strip() if first else ""
        angles.append(_of_pose(named, poses, limits, f"{path}", where) | given)
    return Keyframes(table.times, tuple(angles))


def _of_pose(
    name: str, poses: Mapping[str, Angles] | None, limits: Limits, source: str, where: str
) -> Angles:
    """Angles in rad of a scanned pose within their limits; none where no pose is named or known."""
    if not name or poses is None:
        return {}
    if name not in poses:
        remedy = f"Name one of {', '.join(poses)}"
        raise InputError(source, f"{where}, pose", f"{name!r} is no pose that the rig explains", remedy)
    return {angle: float(np.clip(value, *limits[angle])) for angle, value in poses[name].items()}
