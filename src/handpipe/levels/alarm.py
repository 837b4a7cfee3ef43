"""Whether a pose is like the learned ones: distances to them against their own when each is left out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial.distance import cdist

from handpipe.core import Array
from handpipe.levels import kernels
from handpipe.levels.correctives import Correctives, scaled

STILL = 0.01  # rad, half the least range of an angle
LEAST = 0.02  # of half an angle's range: by as much a pose may always leave it


@dataclass(frozen=True, eq=False)
class Alarm:
    """What is usual among learned poses.

    typical (p,): median distance of a learned pose to the nearest other one, in each part's angles; farthest:
    largest of these distances over the typical ones; lower, upper (a,): range of the angles in rad; gap:
    farthest that a learned pose is outside of the others' range, of half that range.
    """

    typical: Array
    farthest: float
    lower: Array
    upper: Array
    gap: float

    @staticmethod
    def of(angles: Array, correctives: Correctives) -> Alarm:
        """Of learned poses (F, a) in rad; correctives: whose parts are driven by some of the angles each."""
        places = scaled(angles, correctives.lower, correctives.upper)
        at, of_part = correctives.drivers.at, correctives.drivers.of_part
        apart = np.zeros((len(angles), len(at) - 1))
        for p in range(len(at) - 1):
            own = places[:, of_part[at[p] : at[p + 1]]]
            between = cdist(own, own) / np.sqrt(max(own.shape[1], 1))
            np.fill_diagonal(between, np.inf)
            apart[:, p] = between.min(axis=1)
        typical = np.maximum(np.median(apart, axis=0), np.finfo(float).tiny)
        farthest = float((apart / typical).max(initial=0.0))
        ordered = np.sort(angles, axis=0)
        half = np.maximum((ordered[-1] - ordered[0]) / 2, STILL)
        outside = np.maximum(ordered[1] - ordered[0], ordered[-1] - ordered[-2]) / half
        gap = max(float(outside.max(initial=0.0)), LEAST)
        return Alarm(typical, max(farthest, np.finfo(float).tiny), ordered[0], ordered[-1], gap)

    def distance(self, angles: Array, correctives: Correctives) -> float:
        """How far a pose (a,) in rad is from the learned ones: above 1, farther than any of them is."""
        near = np.zeros(len(self.typical))
        kernels.nearest(scaled(angles, correctives.lower, correctives.upper), correctives.drivers, near)
        half = np.maximum((self.upper - self.lower) / 2, STILL)
        beyond = np.maximum(np.maximum(self.lower - angles, angles - self.upper) / half, 0.0)
        by_parts = float((near / self.typical).max(initial=0.0)) / self.farthest
        return max(by_parts, float(beyond.max(initial=0.0)) / self.gap)

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return asdict(self)

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> Alarm:
        """What `to_group` gave, as an artifact returned it."""
        return Alarm(
            group["typical"], float(group["farthest"]), group["lower"], group["upper"], float(group["gap"])
        )
