"""Joint angles of frames as CSV in degrees, and the check against the limits of the joints.

Angles without a column are zero.

frame,MP2_flexion [deg],MP2_abduction [deg],PIP2_flexion [deg]
fist,80,0,95
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from handpipe.core import InputError, write_text
from handpipe.skeleton.joints.frame_table import frame_name, number_in, read_table

Angles = dict[str, float]  # angle name -> rad
Limits = Mapping[str, tuple[float, float]]  # angle name -> lower and upper in rad
UNIT = " [deg]"
SLACK = np.radians(1e-6)  # rad, beyond a limit: rounding of files


def check_angles(angles: Mapping[str, float], limits: Limits, source: str | Path, row: str = "") -> None:
    """Check that angles are complete, known and within their limits.

    Parameters
    ----------
    angles : mapping of str to float
        Angles in rad by name.
    limits : mapping of str to (float, float)
        Lower and upper limit of every angle in rad.
    source : str or Path
        Where the angles come from, for messages.
    row : str
        Place of the angles in the source, for messages.

    Raises
    ------
    InputError
        If an angle is unknown, missing, not a number or beyond its limits.
    """
    check_given_angles(angles, limits, source, row)
    where = f"{row}, " if row else ""
    for name in limits:
        if name not in angles:
            remedy = f"Give every angle: {', '.join(limits)}"
            raise InputError(source, f"{where}{name}", "is missing", remedy)


def check_given_angles(
    angles: Mapping[str, float], limits: Limits, source: str | Path, row: str = ""
) -> None:
    """Check that angles are known and within their limits, as `check_angles` does; some may be missing."""
    where = f"{row}, " if row else ""
    for name in angles:
        if name not in limits:
            remedy = f"The angles are {', '.join(limits)}"
            raise InputError(source, f"{where}{name}", "is not an angle of this rig", remedy)
    for name in (n for n in limits if n in angles):
        (lower, upper), value = limits[name], angles[name]
        if not math.isfinite(value):
            raise InputError(source, f"{where}{name}", "is not a finite number", "Give the angle in degrees")
        if not lower - SLACK <= value <= upper + SLACK:
            low, high, degrees = np.degrees([lower, upper, value])
            raise InputError(
                source,
                f"{where}{name}",
                f"{degrees:.6g} deg is outside its limits of {low:.6g} to {high:.6g} deg",
                "Bring it within the limits, or widen limits_deg of the joint in the dataset file",
            )


def read_angles(path: str | Path, limits: Limits) -> dict[str, Angles]:
    """Joint angles of the frames in a CSV file.

    Cells are separated by commas, semicolons or tabs; with the latter two, numbers may have a decimal comma.
    An angle without a column is zero in every frame.

    Parameters
    ----------
    path : str or Path
        CSV file with angles in degrees.
    limits : mapping of str to (float, float)
        Lower and upper limit of every angle in rad.

    Returns
    -------
    dict of str to dict of str to float
        Angles in rad by frame and angle name, in the order of the file.

    Raises
    ------
    InputError
        If there are no frames, a column is unknown, a frame is repeated, a value is not a number,
        or an angle is beyond its limits. The message names row and column.
    """
    header, lines, decimal_comma = read_table(path)
    columns = _columns(path, header, limits)
    frames: dict[str, Angles] = {}
    for number, row in lines:
        if len(row) != len(columns) + 1:
            raise InputError(
                path, f"row {number}", f"has {len(row)} cells, not {len(columns) + 1}", "Complete it"
            )
        name = frame_name(path, (number, row), [*frames])
        where = f"row {number} (frame {name})"
        given = zip(columns, row[1:], strict=True)
        angles = {c: radians_in(path, where, c, cell, decimal_comma) for c, cell in given}
        angles |= {name: 0.0 for name in limits if name not in angles}
        check_angles(angles, limits, path, where)
        frames[name] = angles
    if not frames:
        raise InputError(path, "rows", "there are none", "Give a row for each frame")
    return frames


def write_angles(path: str | Path, frames: Mapping[str, Mapping[str, float]]) -> None:
    """Write frames as a table of angles in degrees, atomically; `read_angles` reads it.

    Parameters
    ----------
    path : str or Path
        CSV file to be written.
    frames : mapping of str to mapping of str to float
        Angles in rad by frame and angle name, each frame with all angles of the first one.
    """
    names = list(next(iter(frames.values()), {}))
    lines = [",".join(["frame", *(n + UNIT for n in names)])]
    for frame, angles in frames.items():
        cell = f'"{frame}"' if "," in frame else frame
        lines.append(",".join([cell, *(repr(float(np.degrees(angles[n]))) for n in names)]))
    write_text(path, "\n".join(lines) + "\n")


def _columns(path: str | Path, header: list[str], limits: Limits) -> list[str]:
    example = ",".join(["frame", *(n + UNIT for n in limits)])
    if not header or header[0].strip() != "frame":
        raise InputError(
            path, "header", "does not begin with the column 'frame'", f"Begin the file with: {example}"
        )
    return angle_columns(path, header[1:], limits, f"The header is: {example}")


def angle_columns(path: str | Path, cells: list[str], limits: Limits, remedy: str) -> list[str]:
    """The angles that the heads of columns name with their unit; `remedy` is that for an unknown one."""
    names = []
    for cell in cells:
        name = cell.strip()
        if not name.endswith(UNIT):
            plain, _, unit = name.partition(" [")
            if unit:
                problem = f"is in {unit.removesuffix(']')!r}, not in degrees"
                rename = f"Convert it and name it {plain + UNIT!r}"
                raise InputError(path, f"column {name!r}", problem, rename)
            raise InputError(
                path, f"column {name!r}", "does not say its unit", f"Name it like {name + UNIT!r}"
            )
        names.append(name.removesuffix(UNIT))
    for name in names:
        if name not in limits:
            raise InputError(path, f"column {name + UNIT!r}", "is not an angle of this rig", remedy)
        if names.count(name) > 1:
            raise InputError(path, f"column {name + UNIT!r}", "stands twice", "Keep one of the two")
    return names


def radians_in(path: str | Path, where: str, name: str, cell: str, decimal_comma: bool) -> float:
    """The angle in rad that a cell gives in degrees."""
    try:
        return float(np.radians(number_in(cell, decimal_comma)))
    except ValueError as error:
        raise InputError(path, f"{where}, {name}", f"{cell!r} is not a number", "Give degrees") from error
