"""Keys with a name and a time, and the frames between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from handpipe.core import Array, InputError

RATE = 24.0  # frames a second, as exports show them
UNITS = {"frame": 1.0, "s": RATE}  # frames a unit of time
SAME = 1e-6  # frames; a frame that lies as near to a key shows it


@dataclass(frozen=True)
class KeyTimes:
    """Names of keys, and their times (k,) in frames, the first zero and each later than the one before."""

    names: tuple[str, ...]
    times: Array

    @property
    def frames(self) -> Array:
        """Times (n,) of the frames from the first key to the last."""
        return np.arange(np.floor(self.times[-1] + SAME) + 1.0)

    @property
    def frame_names(self) -> list[str]:
        """A key's own name for the frame that shows it; a frame between keys counts from the key before."""
        key = np.searchsorted(self.times - SAME, self.frames, side="right") - 1
        first = np.ceil(self.times - SAME).astype(int)
        exact = np.abs(self.times - first) <= SAME
        names = []
        for frame, k in enumerate(key):
            after = frame - int(first[k]) + (0 if exact[k] else 1)
            names.append(f"{self.names[k]}+{after}" if after else self.names[k])
        return names


def key_times(
    path: str | Path, where: Sequence[str], names: Sequence[str], times: Sequence[float]
) -> KeyTimes:
    """Checked times of keys, moved so that the first key is at zero.

    Parameters
    ----------
    path : str or Path
        File of the keys, for messages.
    where : sequence of str
        Place of each key in the file, for messages.
    names : sequence of str
        Names of the keys.
    times : sequence of float
        Their times in frames.

    Returns
    -------
    KeyTimes

    Raises
    ------
    InputError
        If there are fewer than two keys, or a key is not later than the one before.
    """
    if len(times) < 2:
        raise InputError(path, "keys", f"there are {len(times)} of them", "Give two keys at least")
    for i, (before, after) in enumerate(zip(times, times[1:], strict=False), start=1):
        if not after > before:
            problem = f"is not later than {names[i - 1]!r} before it"
            raise InputError(path, f"{where[i]}, time", problem, "Let the times increase from key to key")
    return KeyTimes(tuple(names), np.array(times) - times[0])
