"""A random stream for each effect: one effect's strength changes no other effect's numbers."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Streams:
    """Random streams by name, of one seed; its first number is the subject's, the others are an image's."""

    seed: Sequence[int]

    def stream(self, name: str) -> np.random.Generator:
        """The stream of a name, from its start."""
        return np.random.default_rng([*self.seed, zlib.crc32(name.encode())])

    def of_subject(self, name: str) -> np.random.Generator:
        """The stream of what all of a subject's images show alike."""
        return Streams(self.seed[:1]).stream(name)
