"""Tables of keys at times: the first column names the keys, the second has their times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import InputError
from handpipe.skeleton.joints.frame_table import delimiter_of, frame_name, number_in, read_table
from handpipe.skeleton.motion.times import UNITS, KeyTimes, key_times

TIMES = {f"time [{unit}]": scale for unit, scale in UNITS.items()}


@dataclass(frozen=True)
class KeyTable:
    """Keys with their times, and what else stands in their rows.

    Parameters
    ----------
    times : KeyTimes
        Names and times of the keys.
    columns : list of str
        Headers of the other columns.
    cells : list of list of str
        The other cells, by key.
    places : list of str
        Where each key stands, for messages.
    decimal_comma : bool
        Whether numbers may have a decimal comma.
    """

    times: KeyTimes
    columns: list[str]
    cells: list[list[str]]
    places: list[str]
    decimal_comma: bool


def begins_with(path: str | Path, word: str) -> bool:
    """Whether the header of a table begins with a word."""
    try:
        with open(path, encoding="utf-8-sig", errors="replace") as file:
            header = file.readline()
            return header.split(delimiter_of(header))[0].strip('" \n') == word
    except OSError:
        return False


def read_key_table(path: str | Path, example: str) -> KeyTable:
    """Read a table of keys.

    Parameters
    ----------
    path : str or Path
        CSV file.
    example : str
        A header that would be right, for messages.

    Returns
    -------
    KeyTable

    Raises
    ------
    InputError
        If a row is not complete, or a time is no number or not later than the one before. It names the row.
    """
    header, lines, decimal_comma = read_table(path)
    if len(header) < 2 or header[1] not in TIMES:
        problem = f"its second column is not one of {', '.join(TIMES)}"
        raise InputError(path, "header", problem, f"Begin the file with: {example}")
    names: list[str] = []
    places, times = [], []
    for line in lines:
        row = line[1]
        names.append(frame_name(path, line, names))
        places.append(f"row {line[0]} (key {names[-1]})")
        if len(row) != len(header):
            raise InputError(path, places[-1], f"has {len(row)} cells, not {len(header)}", "Complete it")
        time = finite_number(path, f"{places[-1]}, time", row[1], decimal_comma)
        times.append(TIMES[header[1]] * time)
    found = key_times(path, places, names, times)
    return KeyTable(found, header[2:], [row[2:] for _, row in lines], places, decimal_comma)


def finite_number(path: str | Path, where: str, cell: str, decimal_comma: bool) -> float:
    """The number in a cell; raises `InputError` where it is none or not finite."""
    try:
        value = number_in(cell, decimal_comma)
    except ValueError as error:
        raise InputError(path, where, f"{cell!r} is not a number", "Give a number") from error
    if not np.isfinite(value):
        raise InputError(path, where, "is not a finite number", "Give a number")
    return value
