"""The least contractions that move a rig's joints as wanted, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from handpipe.core import Array
from handpipe.skeleton.contraction.dynamics import HandState, MuscleDrive

DEGREE = np.radians(1.0)  # rad
WORTH = 3.0  # contraction that counts as much as an error of one degree
ROUNDS = 4  # of a frame, in which the response is linearised anew
STILL = 1e-4  # change of a contraction


@dataclass(frozen=True)
class FoundContractions:
    """Contractions that follow given angles, and the angles that they reach.

    Parameters
    ----------
    contractions : array (n, m)
        Contractions from 0 to 1 by frame and muscle.
    angles : array (n, k)
        Angles in rad that they lead to.
    errors : array (n, k)
        What these miss of the wanted angles, in rad.
    """

    contractions: Array
    angles: Array
    errors: Array


def contractions_of_angles(
    drive: MuscleDrive, frames: Sequence[Mapping[str, float]], seconds: float
) -> FoundContractions:
    """Contractions that move the joints through given angles with little effort.

    Each frame's contractions minimise the squared errors of the angles at its end and the sum of their own
    squares, within 0 and 1, from the state in which the frames before leave the hand. Replaying them with
    `angles_of_contractions` leads to the same angles.

    Parameters
    ----------
    drive : MuscleDrive
        Rig and muscles.
    frames : sequence of mapping of str to float
        Wanted angles in rad by name, frame after frame; the motion begins at rest in the first one.
    seconds : float
        Time between two frames.

    Returns
    -------
    FoundContractions
    """
    wanted = np.array([[frame[name] for name in drive.muscles.angles] for frame in frames])
    held = _holding(drive, wanted[0])
    state = drive.resting(held, drive.muscles.relaxed)
    contractions, reached = [held], [state.angles]
    for target in wanted[1:]:
        held = _towards(drive, state, held, target, seconds)
        state = drive.frame(state, contractions[-1], held, seconds)
        contractions.append(held)
        reached.append(state.angles)
    return FoundContractions(np.array(contractions), np.array(reached), np.array(reached) - wanted)


def _towards(drive: MuscleDrive, state: HandState, before: Array, target: Array, seconds: float) -> Array:
    """Contractions (m,) at the end of a frame that bring the angles near to a target (k,)."""
    found = before
    for _ in range(ROUNDS):
        angles, change = drive.response(state, before, found, seconds)
        rows = np.concatenate([change / DEGREE, np.eye(len(found)) / WORTH])
        right = np.concatenate([(target - angles + change @ found) / DEGREE, np.zeros(len(found))])
        new = np.clip(lsq_linear(rows, right, bounds=(0.0, 1.0)).x, 0.0, 1.0)
        moved = np.abs(new - found).max()
        found = new
        if moved < STILL:
            break
    return found


def _holding(drive: MuscleDrive, angles: Array) -> Array:
    """The least contractions (m,) whose torques balance those against stretch at angles (k,) in rad."""
    muscles = drive.muscles
    pull = muscles.levers.T * muscles.active(angles)
    against = muscles.resistance(angles)
    scale = np.abs(pull).max()
    rows = np.concatenate([1e3 * pull / scale, np.eye(len(muscles.names))])
    right = np.concatenate([-1e3 * against / scale, np.zeros(len(muscles.names))])
    return np.clip(lsq_linear(rows, right, bounds=(0.0, 1.0)).x, 0.0, 1.0)
