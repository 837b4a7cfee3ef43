"""What is expected of a joint before its poses are known, and how well each pose's motion is measured.

With a handful of poses an axis about which a joint hardly turned is not determined by them. The hint of the
dataset file then counts, the more the less the data determine: the estimate is the posterior's mode under
normal errors. How much motion no fixed axis explains is unknown, too; it is estimated from the poses
themselves, together with a usual value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from handpipe.core import Array


class MotionNoise(NamedTuple):
    """Standard deviations, by component, of a measured motion: of its turn in rad, of the joint in mm."""

    rotation: float
    translation: float


@dataclass(frozen=True)
class Prior:
    """Standard deviations, by component, of what is expected of a joint before its poses are known.

    Parameters
    ----------
    tilt : float
        Of a hinted axis in rad; a person draws it 30 deg off at worst.
    centre : float
        Of the gap between the bones from the joint's centre, in mm.
    rotation, translation : float
        Of the motions in a pose that no fixed axis explains, in rad and mm.
    poses : float
        Number of poses that this guess of unexplained motions counts as.
    """

    tilt: float = float(np.radians(15.0))
    centre: float = 5.0
    rotation: float = float(np.radians(1.0))
    translation: float = 0.3
    poses: float = 2.0


PRIOR = Prior()


@dataclass(frozen=True)
class Weighing:
    """Weights of poses and of the prior in a fit.

    Parameters
    ----------
    weights : array (n,)
        Weights of the poses, of mean square one.
    pull : float
        Deviation of a pose's typical error over that of the prior, so that squares of both add up.
    """

    weights: Array
    pull: float

    @staticmethod
    def plain(count: int) -> Weighing:
        """All poses alike and no prior."""
        return Weighing(np.ones(count), 0.0)

    @staticmethod
    def from_deviations(noise: Array, unexplained: float, prior: float) -> Weighing:
        """From deviations (n,) of the poses, that of unexplained motion, and that of the prior."""
        total = np.hypot(noise, unexplained)
        typical = 1 / np.sqrt(np.mean(total**-2.0))
        return Weighing(typical / total, float(typical / prior))


def unexplained(leftover: Array, noise: Array, parameters: int, guess: float, poses: float) -> float:
    """Standard deviation, by component, of motions that no fixed axis explains.

    Parameters
    ----------
    leftover : array (n, k)
        Residual of each pose.
    noise : array (n,)
        Standard deviations that measurement alone explains.
    parameters : int
        Number of parameters of the fit.
    guess : float
        Deviation expected beforehand.
    poses : float
        Number of poses that this guess counts as.

    Returns
    -------
    float
        Deviation in the unit of the residuals.
    """
    count, k = leftover.shape
    squares = max(float((leftover**2).sum() - k * (noise**2).sum()), 0.0)
    free = max(count * k - parameters, 0)
    prior = poses * k
    return float(np.sqrt((prior * guess**2 + squares) / (prior + free)))


def rotation_noise(noise: Sequence[MotionNoise]) -> Array:
    """Deviations (n,) of the turns in rad."""
    return np.array([n.rotation for n in noise])


def translation_noise(noise: Sequence[MotionNoise]) -> Array:
    """Deviations (n,) of the joint's place in mm."""
    return np.array([n.translation for n in noise])
