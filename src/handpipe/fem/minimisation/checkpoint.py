"""States of a long solve on disk, from which an interrupted solve continues."""

from __future__ import annotations

import hashlib
import logging
import os
import time
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handpipe.core import Array

log = logging.getLogger(__name__)


class Checkpoint:
    """The last state (load t, step, positions) of one solve, in a file that is replaced as a whole.

    Only the same problem continues from a state: `begin` computes its fingerprint. States are written at most
    every `every` seconds, and removed by `done`.
    """

    def __init__(self, path: str | Path, every: float = 30.0) -> None:
        self.path, self.every = Path(path), every
        self._fingerprint = ""
        self._written = time.monotonic()
        self._load = self._step = 0.0

    def begin(self, *parts: NDArray | str | float) -> tuple[float, float, Array] | None:
        """The state (t, step, x) of an earlier run of the problem that `parts` describe, if there is one."""
        digest = hashlib.sha256()
        for part in parts:
            digest.update(part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
        self._fingerprint = digest.hexdigest()
        try:
            with np.load(self.path) as state:
                if str(state["fingerprint"]) != self._fingerprint:
                    log.info("%s belongs to another problem; starting from the beginning", self.path)
                    return None
                return float(state["load"]), float(state["step"]), state["x"]
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            log.warning("%s cannot be read (%s); starting from the beginning", self.path, error)
            return None

    def at(self, load: float, step: float) -> None:
        """The states saved from now on belong to this load and step."""
        self._load, self._step = load, step

    def save(self, x: Array) -> None:
        """Write positions x (n, 3) now."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        partial = self.path.with_name(self.path.name + ".partial")
        with partial.open("wb") as file:
            np.savez(file, x=x, load=self._load, step=self._step, fingerprint=self._fingerprint)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(self.path)
        self._written = time.monotonic()

    def save_when_due(self, x: Array) -> None:
        """Write positions x (n, 3) if the last state is old enough."""
        if time.monotonic() - self._written >= self.every:
            self.save(x)

    def done(self) -> None:
        """Remove the file."""
        self.path.unlink(missing_ok=True)
