"""Targets of inverse kinematics at times, as a YAML file.

unit: frame            # of times: frame, or s of 24 frames
flesh: 6               # mm between a bone and the pad on it
keys:
  - {name: open, time: 0}
  - {name: pinch, time: 40, touch: [[distal1, distal2]], angles: {MP3_flexion: 20}}
  - {name: aim, time: 80, reach: [{bone: distal2, at: tip, to: [190, 20, -40]}]}
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from handpipe.core import InputError
from handpipe.core.configuration import Model, Name, Vector, load_yaml
from handpipe.skeleton.joints.angles import Limits, check_given_angles
from handpipe.skeleton.motion.times import UNITS, KeyTimes, key_times


def _bone(value: Any) -> Any:
    return {"bone": value} if isinstance(value, str) else value


class BonePoint(Model):
    """A point of a bone, or of the skin on it.

    `at` is the pad (skin palmar of the bone's end), the back (skin dorsal of its middle), the tip, or neutral
    coordinates in mm.
    """

    bone: Name
    at: Literal["pad", "back", "tip"] | Vector = "pad"


class Goal(BonePoint):
    """A point of a bone, and where it is to be in mm in the neutral frame, with the root bone at rest."""

    to: Vector


End = Annotated[BonePoint, BeforeValidator(_bone)]


class TargetKey(Model):
    """What is to be met at a time.

    Free joints keep near to `angles` in degrees. Bones that are `still` stay where these angles put them.
    """

    name: str | None = None
    time: float
    touch: tuple[tuple[End, End], ...] = ()
    reach: tuple[Goal, ...] = ()
    still: tuple[Name, ...] = ()
    angles: dict[Name, float] = {}

    @property
    def radians(self) -> dict[str, float]:
        """Its angles in rad."""
        return {name: float(np.radians(value)) for name, value in self.angles.items()}


class TargetFile(Model):
    """Keys of targets in the order of their times."""

    unit: Literal["frame", "s"] = "frame"
    flesh: float = Field(6.0, ge=0, le=30, description="mm between a bone and the pad on it")
    keys: tuple[TargetKey, ...]

    @property
    def names(self) -> list[str]:
        """Names of the keys; a key without one is key1, key2, ... by its number."""
        return [key.name or f"key{i}" for i, key in enumerate(self.keys, start=1)]


def read_targets(
    path: str | Path, limits: Limits, bones: tuple[str, ...] = ()
) -> tuple[TargetFile, KeyTimes]:
    """Read a file of targets.

    Parameters
    ----------
    path : str or Path
        YAML file.
    limits : mapping of str to (float, float)
        Lower and upper limit of every angle in rad.
    bones : tuple of str, optional
        Bones of the rig; without them their names are not checked.

    Returns
    -------
    TargetFile
        The keys.
    KeyTimes
        Their times.

    Raises
    ------
    InputError
        If a field is wrong, two keys have one name, times do not increase, a bone or an angle is unknown, or
        an angle is beyond its limits.
    """
    found = load_yaml(path, TargetFile)
    names = found.names
    where = [f"keys.{i} ({name})" for i, name in enumerate(names)]
    for i, (key, place) in enumerate(zip(found.keys, where, strict=True)):
        if names[i] in names[:i] or not names[i].isprintable():
            raise InputError(path, place, "its name is another key's or cannot be printed", "Name it anew")
        check_given_angles(key.radians, limits, path, f"{place}, angles")
        for bone in _bones(key):
            if bones and bone not in bones:
                raise InputError(path, place, f"no bone {bone!r}", f"The bones are {', '.join(bones)}")
    return found, key_times(path, where, names, [UNITS[found.unit] * key.time for key in found.keys])


def _bones(key: TargetKey) -> list[str]:
    return [p.bone for pair in key.touch for p in pair] + [goal.bone for goal in key.reach] + [*key.still]
