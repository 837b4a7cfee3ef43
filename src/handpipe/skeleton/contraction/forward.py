"""Angles of frames from contractions over time, by way of the hand's motion from one frame to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray
from handpipe.skeleton.contraction.dynamics import MuscleDrive


@dataclass(frozen=True)
class MusclePlay:
    """What contractions lead to.

    Parameters
    ----------
    angles : array (n, k)
        Angles in rad by frame.
    at_limit : array (n, k) of bool
        Whether a limit stops the angle.
    """

    angles: Array
    at_limit: BoolArray


def angles_of_contractions(drive: MuscleDrive, contractions: Array, seconds: float) -> MusclePlay:
    """Angles of frames under contractions.

    The hand begins at rest under the first contractions, where it comes to from the relaxed hand.

    Parameters
    ----------
    drive : MuscleDrive
        Rig and muscles.
    contractions : array (n, m)
        Contractions from 0 to 1 by frame and muscle.
    seconds : float
        Time between two frames.

    Returns
    -------
    MusclePlay
    """
    state = drive.resting(contractions[0], drive.muscles.relaxed)
    angles = [state.angles]
    for before, after in zip(contractions[:-1], contractions[1:], strict=True):
        state = drive.frame(state, before, after, seconds)
        angles.append(state.angles)
    found = np.array(angles)
    return MusclePlay(found, (found <= drive.lower) | (found >= drive.upper))
