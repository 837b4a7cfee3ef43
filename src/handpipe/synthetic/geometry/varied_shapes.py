"""Shapes of another person: moved and swollen by a smooth field that no map by the bones explains.

One field for all organs between the bones: in every person they fit to one another.
"""

from __future__ import annotations

import zlib

import numpy as np

from handpipe.core import Array
from handpipe.mesh.surfaces import Distance

LENGTH = 12.0  # mm over which shapes vary: the standard deviation of the Gaussian that correlates them
ORGANS, BONES = 0.8, 0.3  # mm, standard deviation of each component
FADING = 4.0  # mm from bones, within which organs vary less: a part on a bone is on it in everybody
WAVES = 400  # random waves of one field


class Variation:
    """A map of points (n, 3) in mm: moved by a Gaussian field that is smooth over `LENGTH`, one of each name.

    The gradient's components have a standard deviation of sd / LENGTH, far below one: no folds.
    sd: mm, of the displacement's components; bones: on these nothing moves, where they are given.
    """

    def __init__(self, seed: int, name: str, sd: float, bones: Distance | None = None) -> None:
        rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
        self._waves = rng.standard_normal((WAVES, 3)) / LENGTH
        self._phases = rng.uniform(0.0, 2.0 * np.pi, WAVES)
        self._amplitudes = sd * np.sqrt(2.0 / WAVES) * rng.standard_normal((WAVES, 3))
        self._bones = bones

    def __call__(self, points: Array) -> Array:
        """Positions (n, 3) in mm of the displaced points (n, 3)."""
        field = np.cos(points @ self._waves.T + self._phases) @ self._amplitudes
        if self._bones is not None:
            field *= _faded(self._bones.closest(points)[0])[:, None]
        return points + field


def _faded(distances: Array) -> Array:
    """From 0 on a bone to 1 at `FADING`, smooth at both ends."""
    t = np.clip(distances / FADING, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)
