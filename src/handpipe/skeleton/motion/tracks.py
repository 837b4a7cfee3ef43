"""Tracked points of hands over time, as a Leap Motion controller gives them, one row a hand and frame.

frame,timestamp_us,side,hand_id,confidence,…,thumb_mcp_x,thumb_mcp_y,thumb_mcp_z,…,little_tip_z

Each digit has the points mcp, pip, dip and tip in mm. The thumb's are its carpometacarpal,
metacarpophalangeal and interphalangeal joints and its tip: the controller gives it no metacarpal.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError, read_text
from handpipe.core.configuration import Recording
from handpipe.skeleton.drivers.landmarks import LANDMARKS, Hand
from handpipe.skeleton.joints.frame_table import number_in

DIGITS = ("thumb", "index", "middle", "ring", "little")
POINTS = tuple(f"{digit}_{end}" for digit in DIGITS for end in ("mcp", "pip", "dip", "tip"))
NAMES = LANDMARKS[1:]  # of the same points in the same order
PALM = tuple(f"palm_direction_{c}" for c in "xyz")
COLUMNS = ("timestamp_us", "side", "confidence", *(f"{point}_{c}" for point in POINTS for c in "xyz"))
SURE = 0.2  # confidence of the tracker; a row of less counts as missing


@dataclass(frozen=True)
class Track:
    """One hand over time.

    Parameters
    ----------
    times : array (n,)
        Times of the rows in s, increasing, the first one zero.
    points : array (n, 20, 3)
        Points in the order of `NAMES`, mm.
    directions : array (n, 3) or None
        Unit direction of the palm towards the fingers, where the file has it.
    hand : str
        "right" or "left".
    unsure : int
        Rows that were left out because the tracker was not sure of them.
    """

    times: Array
    points: Array
    directions: Array | None
    hand: Hand
    unsure: int

    def gaps(self, longer: float) -> list[tuple[float, float]]:
        """First and last time in s of each stretch without rows that is longer than so many s."""
        gaps = np.diff(self.times)
        return [
            (float(self.times[i]), float(self.times[i + 1]))
            for i in np.flatnonzero(gaps > max(longer, self.step * 1.5))
        ]

    @property
    def step(self) -> float:
        """Usual time from row to row in s."""
        return float(np.median(np.diff(self.times)))


def is_track_table(path: str | Path) -> bool:
    """Whether a table holds tracked points, by its header."""
    try:
        with open(path, encoding="utf-8-sig", errors="replace") as file:
            return "timestamp_us" in file.readline().strip().split(",")
    except OSError:
        return False


def read_track(path: str | Path, side: Hand) -> Track:
    """Read one hand of a recording.

    Parameters
    ----------
    path : str or Path
        CSV file.
    side : str
        "right" or "left".

    Returns
    -------
    Track

    Raises
    ------
    InputError
        If a column or the hand is missing, a cell is not a number, or times do not increase.
    """
    reader = csv.DictReader(io.StringIO(read_text(path), newline=""))
    missing = [c for c in COLUMNS if c not in (reader.fieldnames or ())]
    if missing:
        problem = f"there is no column {missing[0]!r}"
        raise InputError(path, "header", problem, f"The columns are {', '.join(COLUMNS[:5])}, …")
    rows = [(n, row) for n, row in enumerate(reader, start=2) if row["side"] == side]
    known = PALM if set(PALM) <= set(reader.fieldnames or ()) else ()
    numbers = np.array([_numbers(path, n, row, known) for n, row in rows]).reshape(
        len(rows), len(COLUMNS) - 1 + len(known)
    )
    sure = numbers[:, 1] >= SURE if len(rows) else np.zeros(0, bool)
    if sure.sum() < 3:
        problem = f"there are {sure.sum()} rows of a {side} hand with a confidence of {SURE} and more"
        raise InputError(path, "side", problem, "Name the other hand in `recording.side`")
    seconds = numbers[:, 0] * 1e-6
    late = np.flatnonzero(np.diff(seconds) <= 0)
    if late.size:
        problem = "is not later than the hand's row before it"
        raise InputError(path, f"row {rows[late[0] + 1][0]}, timestamp_us", problem, "Sort the rows by time")
    points = numbers[sure, 2 : 2 + 3 * len(POINTS)].reshape(-1, len(POINTS), 3)
    directions = numbers[sure, -3:] if known else None
    return Track(seconds[sure] - seconds[sure][0], points, directions, side, int((~sure).sum()))


def frame_times(path: str | Path, track: Track, recording: Recording) -> dict[str, float]:
    """Times in s of a scene's frames by name; a gap that is too long to be bridged has none.

    Raises
    ------
    InputError
        If the recording has fewer frames than are asked for.
    """
    last = (track.times[-1] - recording.start) * recording.rate + 1e-6
    numbers = np.arange(max(int(np.floor(last)) + 1, 0))
    times = recording.start + numbers / recording.rate
    for first, end in track.gaps(recording.bridge):
        there = (times <= first) | (times >= end)
        numbers, times = numbers[there], times[there]
    count = len(numbers) if recording.count is None else recording.count
    if not 0 < count <= len(numbers):
        problem = f"asks for {count} frames, but the recording has {len(numbers)} of its {track.hand} hand"
        remedy = "Ask for fewer, raise `rate` or `bridge`, or lower `start`"
        raise InputError(path, "recording", problem, remedy)
    return {f"frame{n + 1}": float(t) for n, t in zip(numbers[:count], times[:count], strict=True)}


def _numbers(path: str | Path, number: int, row: dict[str, str], further: Sequence[str]) -> Sequence[float]:
    """Time in us, confidence, coordinates of all points, and of further columns."""
    cells = [row[c] for c in (*COLUMNS, *further) if c != "side"]
    try:
        values = [number_in(cell or "") for cell in cells]
    except ValueError as error:
        raise InputError(path, f"row {number}", str(error), "Leave out the row, or complete it") from error
    if not np.isfinite(values).all():
        raise InputError(path, f"row {number}", "has a number that is not finite", "Leave out the row")
    return values
