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
from handpipe.skeleton.joints.frame_table import Line, delimiter_of, frame_name, number_in, read_table
from handpipe.skeleton.motion.times import UNITS, KeyTimes, key_times

KEY, POSE = "key", "pose"
TIMES = {f"time [{unit}]": scale for unit, scale in UNITS.items()}


@dataclass(frozen=True)
class Keyframes:
    """Keys with their times, and the angles in rad that each of them gives."""

    times: KeyTimes
    angles: tuple[Angles, ...]


def is_keyframe_table(path: str | Path) -> bool:
    """Whether a table holds keyframes, by its header."""
    try:
        with open(path, encoding="utf-8-sig", errors="replace") as file:
            header = file.readline()
            return header.split(delimiter_of(header))[0].strip('" \n') == KEY
    except OSError:
        return False


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
    header, lines, decimal_comma = read_table(path)
    if len(header) < 2 or header[1] not in TIMES:
        remedy = f"Begin the file with: {KEY},{next(iter(TIMES))},{next(iter(limits), 'MP2_flexion')}{UNIT}"
        raise InputError(path, "header", f"its second column is not one of {', '.join(TIMES)}", remedy)
    first = 3 if header[2:3] == [POSE] else 2  # column of angles
    columns = angle_columns(path, header[first:], limits, f"The angles are {', '.join(limits)}")
    names: list[str] = []
    times, angles = [], []
    for line in lines:
        row = line[1]
        names.append(frame_name(path, line, names))
        where = f"row {line[0]} (key {names[-1]})"
        if len(row) != len(header):
            raise InputError(path, where, f"has {len(row)} cells, not {len(header)}", "Complete it")
        times.append(TIMES[header[1]] * _number(path, f"{where}, time", row[1], decimal_comma))
        cells = dict(zip(columns, row[first:], strict=True))
        given = {
            name: radians_in(path, where, name, cell, decimal_comma)
            for name, cell in cells.items()
            if cell.strip()
        }
        check_given_angles(given, limits, path, where)
        named = row[2].strip() if first == 3 else ""
        angles.append(_of_pose(named, poses, limits, f"{path}", where) | given)
    return Keyframes(key_times(path, _places(lines, names), names, times), tuple(angles))


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


def _places(lines: list[Line], names: list[str]) -> list[str]:
    return [f"row {number} (key {name})" for (number, _), name in zip(lines, names, strict=True)]


def _number(path: str | Path, where: str, cell: str, decimal_comma: bool) -> float:
    try:
        value = number_in(cell, decimal_comma)
    except ValueError as error:
        raise InputError(path, where, f"{cell!r} is not a number", "Give a number") from error
    if not np.isfinite(value):
        raise InputError(path, where, "is not a finite number", "Give a number")
    return value
