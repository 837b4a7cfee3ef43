"""Keyframes as a table of angles at times.

key,time [frame],MP2_flexion [deg],PIP2_flexion [deg]
open,0,0,0
fist,131,66,88

Times are frames, or seconds (`time [s]`, 24 frames each). A key does not give an angle whose cell is empty.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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

KEY = "key"


@dataclass(frozen=True)
class Keyframes:
    """Keys with their times, and the angles in rad that each of them gives."""

    times: KeyTimes
    angles: tuple[Angles, ...]


def is_keyframe_table(path: str | Path) -> bool:
    """Whether a table holds keyframes, by its header."""
    return begins_with(path, KEY)


def read_keyframes(path: str | Path, limits: Limits) -> Keyframes:
    """Read a table of keyframes.

    Parameters
    ----------
    path : str or Path
        CSV file with angles in degrees.
    limits : mapping of str to (float, float)
        Lower and upper limit of every angle in rad.

    Returns
    -------
    Keyframes

    Raises
    ------
    InputError
        If an angle is unknown, times do not increase, or an angle is beyond its limits. It names row and
        column.
    """
    example = f"{KEY},{next(iter(TIMES))},{next(iter(limits), 'MP2_flexion')}{UNIT}"
    table = read_key_table(path, example)
    columns = angle_columns(path, table.columns, limits, f"The angles are {', '.join(limits)}")
    angles = []
    for where, row in zip(table.places, table.cells, strict=True):
        given = {
            name: radians_in(path, where, name, cell, table.decimal_comma)
            for name, cell in zip(columns, row, strict=True)
            if cell.strip()
        }
        check_given_angles(given, limits, path, where)
        angles.append(given)
    return Keyframes(table.times, tuple(angles))
