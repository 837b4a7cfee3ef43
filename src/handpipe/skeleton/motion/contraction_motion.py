"""Frames of a motion from contractions of muscles over time, as a table of keys.

contraction,time [frame],flexor_digitorum_profundus_2,extensor_digitorum_2
rest,0,0,0
bent,12,0.6,0.1

Times are frames, or seconds (`time [s]`, 24 frames each). Values are from 0 to 1. A key does not give a value
whose cell is empty; a muscle without a column does not contract.
"""

from __future__ import annotations

import csv
import io
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, BoolArray, InputError, write_text
from handpipe.skeleton.contraction import MuscleDrive, PseudoMuscles, angles_of_contractions, every_muscle
from handpipe.skeleton.motion.interpolation import spline
from handpipe.skeleton.motion.key_table import TIMES, begins_with, finite_number, read_key_table
from handpipe.skeleton.motion.motion import Motion
from handpipe.skeleton.motion.times import RATE, KeyTimes
from handpipe.skeleton.rig.rig import Rig

LOG = logging.getLogger(__name__)
KEY = "contraction"
LEAST = 5e-5  # of a contraction, as it is written


@dataclass(frozen=True)
class Contractions:
    """Keys, and the contractions from 0 to 1 by muscle: key numbers (k,) and values (k,)."""

    times: KeyTimes
    values: dict[str, tuple[Array, Array]]

    def frames(self, muscles: PseudoMuscles) -> Array:
        """Contractions (n, m) of muscles in each frame, by monotone splines through their keys."""
        found = np.zeros((len(self.times.frames), len(muscles.names)))
        for i, name in enumerate(muscles.names):
            if name in self.values:
                keys, given = self.values[name]
                found[:, i] = spline(self.times.times[keys], given, self.times.frames)
        return found


def is_contraction_table(path: str | Path) -> bool:
    """Whether a table holds contractions, by its header."""
    return begins_with(path, KEY)


def read_contractions(path: str | Path) -> Contractions:
    """Read a table of contractions.

    Parameters
    ----------
    path : str or Path
        CSV file.

    Returns
    -------
    Contractions

    Raises
    ------
    InputError
        If a muscle is unknown, times do not increase, or a value is not from 0 to 1. It names row and column.
    """
    known = every_muscle()
    table = read_key_table(path, f"{KEY},{next(iter(TIMES))},{known[0]}")
    for name in table.columns:
        if name not in known:
            raise InputError(path, f"column {name}", "is no muscle", f"The muscles are {', '.join(known)}")
        if table.columns.count(name) > 1:
            raise InputError(path, f"column {name}", "is there more than once", "Leave one of them")
    values = {}
    for column, name in enumerate(table.columns):
        given = [
            (key, _contraction(path, f"{table.places[key]}, {name}", row[column], table.decimal_comma))
            for key, row in enumerate(table.cells)
            if row[column].strip()
        ]
        if given:
            values[name] = np.array([key for key, _ in given]), np.array([value for _, value in given])
    return Contractions(table.times, values)


def read_contraction_motion(path: str | Path, rig: Rig) -> Motion:
    """Angles of a scene's frames from contractions, by the motion of the hand that they bring about.

    Parameters
    ----------
    path : str or Path
        CSV file of contractions.
    rig : Rig
        Rig whose joints the muscles move.

    Returns
    -------
    Motion
        Angles in rad within their limits by frame, and what limits stop.

    Raises
    ------
    InputError
        If the file is wrong, or no muscle acts on the rig's joints.

    References
    ----------
    Albrecht 2003 §4.1.
    """
    contractions, drive = read_contractions(path), MuscleDrive.of_rig(rig)
    play = angles_of_contractions(drive, contractions.frames(drive.muscles), 1.0 / RATE)
    said = _said(contractions, drive, play.at_limit)
    for sentence in said:
        LOG.info("%s: %s", path, sentence)
    frames = {
        name: dict(zip(rig.angle_names, map(float, row), strict=True))
        for name, row in zip(contractions.times.frame_names, play.angles, strict=True)
    }
    return Motion(frames, {}, said)


def write_contractions(
    path: str | Path, muscles: PseudoMuscles, names: Sequence[str], contractions: Array
) -> None:
    """Write contractions, one key a frame; muscles that never contract have no column.

    Parameters
    ----------
    path : str or Path
        CSV file to be written.
    muscles : PseudoMuscles
        The muscles.
    names : sequence of str
        Names of the n frames.
    contractions : array (n, m)
        Contractions from 0 to 1.
    """
    columns = [i for i in range(len(muscles.names)) if contractions[:, i].max() >= LEAST]
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow([KEY, next(iter(TIMES)), *(muscles.names[i] for i in columns)])
    for number, name in enumerate(names):
        table.writerow([name, number, *(f"{contractions[number, i]:.4f}" for i in columns)])
    write_text(path, text.getvalue())


def _contraction(path: str | Path, where: str, cell: str, decimal_comma: bool) -> float:
    value = finite_number(path, where, cell, decimal_comma)
    if not 0.0 <= value <= 1.0:
        raise InputError(path, where, f"is {value:g}", "Give 0 for none to 1 for full contraction")
    return value


def _said(contractions: Contractions, drive: MuscleDrive, at_limit: BoolArray) -> list[str]:
    """Sentences on angles that limits stop, and on muscles that move none of the rig's joints."""
    muscles = drive.muscles
    idle = [n for n, (_, v) in contractions.values.items() if n not in muscles.names and v.any()]
    said = [f"{name} moves no joint of this rig" for name in idle]
    for name, frames in zip(muscles.angles, at_limit.sum(axis=0), strict=True):
        if frames:
            said.append(f"{name} is stopped by its limit in {frames} of {len(at_limit)} frames")
    return said
