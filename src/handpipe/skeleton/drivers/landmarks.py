"""Hand landmarks as MediaPipe gives them, 21 points a frame, read from JSON or CSV.

CSV: frame,WRIST_x [m],WRIST_y [m],WRIST_z [m],THUMB_CMC_x [m],...
JSON: {"units": "m", "handedness": "Right", "frames": [[[x, y, z], ... 21 points], ...]}
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from handpipe.core import Array, InputError, read_text
from handpipe.skeleton.joints.frame_table import delimiter_of, frame_name, number_in, read_table

Hand = Literal["right", "left"]
FINGERS = ("INDEX_FINGER", "MIDDLE_FINGER", "RING_FINGER", "PINKY")
LANDMARKS = (
    "WRIST",
    *(f"THUMB_{joint}" for joint in ("CMC", "MCP", "IP", "TIP")),
    *(f"{finger}_{joint}" for finger in FINGERS for joint in ("MCP", "PIP", "DIP", "TIP")),
)
UNITS = ("m", "mm", "px")
REMEDY_UNITS = "Give m, mm or px; points from 0 to 1 of an image times its width (x, z) and height (y) are px"


@dataclass(frozen=True)
class HandLandmarks:
    """Landmarks of a hand in several frames.

    Parameters
    ----------
    names : tuple of str
        Names of the frames.
    points : array (frames, 21, 3)
        Landmarks in units of their own: only their shape counts. Axes are right-handed: x to the right of the
        image, y down, z away from the camera.
    hand : str or None
        "right" or "left": the hand that the points show; None if the file does not say.
    """

    names: tuple[str, ...]
    points: Array
    hand: Hand | None


def read_landmarks(path: str | Path) -> HandLandmarks:
    """Read landmarks from a .json or .csv file; raises `InputError` naming frame and landmark."""
    return _from_json(path, read_text(path)) if Path(path).suffix.lower() == ".json" else _from_csv(path)


def is_landmark_table(path: str | Path) -> bool:
    """Whether a CSV file holds landmarks and not joint angles, by its header."""
    try:
        with open(path, encoding="utf-8-sig", errors="replace") as file:
            header = file.readline()
            return any(cell.strip('" ').startswith("WRIST_") for cell in header.split(delimiter_of(header)))
    except OSError:
        return False


def _from_json(path: str | Path, text: str) -> HandLandmarks:
    try:
        data = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(path, "JSON", str(error), "Mend the syntax") from error
    example = '{"units": "m", "handedness": "Right", "frames": [[[x, y, z], ... 21 points], ...]}'
    if not isinstance(data, dict) or not isinstance(data.get("frames"), list) or not data["frames"]:
        raise InputError(path, "frames", "is missing or empty", f"Write {example}")
    _check_units(path, "units", data.get("units"))
    hand = data.get("handedness")
    if hand not in (None, "Right", "Left"):
        raise InputError(path, "handedness", f"is {hand!r}", "Give Right or Left, or leave it out")
    frames = [_json_points(path, i, frame) for i, frame in enumerate(data["frames"], start=1)]
    names = tuple(f"frame{i}" for i in range(1, len(frames) + 1))
    return HandLandmarks(names, np.array(frames), None if hand is None else hand.lower())


def _json_points(path: str | Path, number: int, frame: Any) -> Array:
    where = f"frames[{number - 1}]"
    if not isinstance(frame, list) or len(frame) != len(LANDMARKS):
        problem = f"has {len(frame)} points" if isinstance(frame, list) else "is not a list"
        raise InputError(path, where, problem, f"Give {len(LANDMARKS)} points, or leave the frame out")
    points = []
    for name, point in zip(LANDMARKS, frame, strict=True):
        values = [point.get(c) for c in "xyz"] if isinstance(point, dict) else point
        points.append(_numbers(path, f"{where}, {name}", values))
    return _checked(path, where, np.array(points))


def _checked(path: str | Path, where: str, points: Array) -> Array:
    """The points (21, 3) of a frame; detectors write one point again and again for what they do not find."""
    remedy = "Leave the frame out, or give all points"
    if not points.any():
        raise InputError(path, where, "all points are 0, 0, 0: no hand was found", remedy)
    places, counts = np.unique(points, axis=0, return_counts=True)
    if (counts > 1).any():
        place = places[counts > 1][0]
        names = [name for name, point in zip(LANDMARKS, points, strict=True) if (point == place).all()]
        problem = f"{', '.join(names)} are at one point, {', '.join(f'{c:g}' for c in place)}"
        raise InputError(path, where, problem, remedy)
    return points


def _from_csv(path: str | Path) -> HandLandmarks:
    header, lines, decimal_comma = read_table(path)
    unit = header[1].partition(" [")[2].removesuffix("]") if len(header) > 1 else None
    _check_units(path, "header", unit)
    wanted = ["frame", *(f"{name}_{c} [{unit}]" for name in LANDMARKS for c in "xyz")]
    for number, column in enumerate(wanted):
        if number >= len(header) or header[number] != column:
            problem = f"column {number + 1} is not {column!r}"
            raise InputError(path, "header", problem, f"The header is: {','.join(wanted[:5])},...")
    names: list[str] = []
    frames = []
    for number, row in lines:
        name = frame_name(path, (number, row), names)
        where = f"row {number} (frame {name})"
        if len(row) != len(wanted):
            raise InputError(path, where, f"has {len(row)} cells, not {len(wanted)}", "Complete it")
        names.append(name)
        cells = np.array(row[1:]).reshape(-1, 3)
        points = [
            _numbers(path, f"{where}, {landmark}", cell, decimal_comma)
            for landmark, cell in zip(LANDMARKS, cells, strict=True)
        ]
        frames.append(_checked(path, where, np.array(points)))
    if not frames:
        raise InputError(path, "rows", "there are none", "Give a row for each frame")
    return HandLandmarks(tuple(names), np.array(frames), None)


def _check_units(path: str | Path, field: str, unit: str | None) -> None:
    if unit not in UNITS:
        raise InputError(
            path, field, f"does not say its unit ({unit!r})" if unit else "has no unit", REMEDY_UNITS
        )


def _numbers(path: str | Path, where: str, values: Iterable[Any], decimal_comma: bool = False) -> list[float]:
    try:
        numbers = [number_in(v, decimal_comma) if isinstance(v, str) else float(v) for v in values]
    except (TypeError, ValueError) as error:
        raise InputError(path, where, f"{values} are not numbers", "Give x, y and z") from error
    if len(numbers) != 3 or not np.isfinite(numbers).all():
        raise InputError(path, where, "is not three finite numbers", "Give x, y and z")
    return numbers
