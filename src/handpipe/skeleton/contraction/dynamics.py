"""Motion of joint angles under contractions: a step that is stable for any length (Albrecht 2003, Eq. 1-4).

The equations are M w' = T(phi, c) - mu w, phi' = w, with the muscles' torques T and viscous friction mu. The
paper's explicit step needs less than M / mu, a few milliseconds for the tip of a finger. Here friction and
the stiffness of the muscles are taken at the end of the step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from handpipe.core import Array, ConvergenceError
from handpipe.skeleton.contraction.inertia import BoneMasses
from handpipe.skeleton.contraction.pseudo_muscles import PseudoMuscles
from handpipe.skeleton.joints.joint_tree import JointTree

FRICTION = 1.5e4  # mN mm s, of each joint: 0.015 N m s
STEPS = 10  # of a frame
FRAME = 1 / 24  # s, between frames while a hand comes to rest
LONGEST_REST, AT_REST = 240, 1e-4  # frames in which it does, at most; rad/s
ROUNDS = 8  # in which joints that reach a limit are found, at most


@dataclass(frozen=True)
class HandState:
    """How a hand is posed and moves.

    Parameters
    ----------
    angles : array (k,)
        Joint angles in rad.
    rates : array (k,)
        Their rates in rad/s.
    """

    angles: Array
    rates: Array


@dataclass(frozen=True)
class MuscleDrive:
    """A rig that pseudo muscles move.

    Parameters
    ----------
    muscles : PseudoMuscles
        The muscles, on all angles of the rig.
    bones : BoneMasses
        Masses of the bones.
    lower, upper : array (k,)
        Limits of the angles in rad.
    """

    muscles: PseudoMuscles
    bones: BoneMasses
    lower: Array
    upper: Array

    @staticmethod
    def of_rig(rig: JointTree) -> MuscleDrive:
        """The drive of a rig.

        Parameters
        ----------
        rig : JointTree
            The rig.

        Returns
        -------
        MuscleDrive

        Raises
        ------
        InputError
            If no pseudo muscle acts on its joints.
        """
        lower, upper = np.array([rig.limits[name] for name in rig.angle_names]).T
        return MuscleDrive(PseudoMuscles.of_limits(rig.limits), BoneMasses.of_rig(rig), lower, upper)

    def frame(self, state: HandState, before: Array, after: Array, seconds: float) -> HandState:
        """The state a frame later, under contractions that change evenly.

        Parameters
        ----------
        state : HandState
            Where the frame begins.
        before, after : array (m,)
            Contractions from 0 to 1 at its beginning and end.
        seconds : float
            Its length.

        Returns
        -------
        HandState
            Where it ends. The moments of inertia are those of its beginning.
        """
        mass = self.bones.matrix(state.angles)
        for step in range(1, STEPS + 1):
            contractions = before + step / STEPS * (after - before)
            state = self.step(state, contractions, mass, seconds / STEPS)
        return state

    def step(self, state: HandState, contractions: Array, mass: Array, seconds: float) -> HandState:
        """The state after one step; an angle that reaches its limit stops there.

        Parameters
        ----------
        state : HandState
            Where the step begins.
        contractions : array (m,)
            Contractions from 0 to 1 at its end.
        mass : array (k, k)
            Mass matrix in kg mm^2.
        seconds : float
            Length of the step.

        Returns
        -------
        HandState
            Where it ends.
        """
        matrix, load = self._system(state, contractions, mass, seconds)
        stopped = np.zeros(len(load), dtype=bool)
        rates = np.zeros(len(load))
        ends = np.zeros(len(load))
        for _ in range(ROUNDS):
            moving = ~stopped
            rates[stopped] = (ends[stopped] - state.angles[stopped]) / seconds
            right = load[moving] - matrix[np.ix_(moving, stopped)] @ rates[stopped]
            rates[moving] = np.linalg.solve(matrix[np.ix_(moving, moving)], right)
            angles = state.angles + seconds * rates
            beyond = moving & ((angles < self.lower) | (angles > self.upper))
            if not beyond.any():
                break
            ends[beyond] = np.clip(angles, self.lower, self.upper)[beyond]
            stopped |= beyond
        angles = np.clip(state.angles + seconds * rates, self.lower, self.upper)
        return HandState(angles, np.where(stopped, 0.0, rates))

    def _system(
        self, state: HandState, contractions: Array, mass: Array, seconds: float
    ) -> tuple[Array, Array]:
        """Matrix (k, k) and right-hand side (k,) of the rates at the end of a step."""
        muscles = self.muscles
        matrix = mass + seconds * FRICTION * np.eye(len(mass))
        matrix += seconds**2 * muscles.stiffness(state.angles, contractions)
        return matrix, mass @ state.rates + seconds * muscles.torques(state.angles, contractions)

    def response(self, state: HandState, before: Array, after: Array, seconds: float) -> tuple[Array, Array]:
        """The angles (k,) a frame later if nothing stopped them, and their derivatives (k, m) by `after`."""
        free = replace(self, lower=np.full(len(self.lower), -np.inf), upper=np.full(len(self.lower), np.inf))
        mass, short = self.bones.matrix(state.angles), seconds / STEPS
        change: Array = np.zeros(self.muscles.levers.T.shape)
        rate_change: Array = np.zeros_like(change)
        for step in range(1, STEPS + 1):
            contractions = before + step / STEPS * (after - before)
            matrix, _ = self._system(state, contractions, mass, short)
            pull = self.muscles.levers.T * (step / STEPS * self.muscles.active(state.angles))
            stiffness = self.muscles.stiffness(state.angles, contractions)
            right = mass @ rate_change + short * (pull - stiffness @ change)
            rate_change = np.asarray(np.linalg.solve(matrix, right), dtype=float)
            change = change + short * rate_change
            state = free.step(state, contractions, mass, short)
        return state.angles, change

    def resting(self, contractions: Array, angles: Array) -> HandState:
        """Where the hand comes to rest under contractions (m,) from angles (k,) in rad.

        Raises `ConvergenceError` where it does not.
        """
        state = HandState(np.clip(angles, self.lower, self.upper), np.zeros(len(angles)))
        for _ in range(LONGEST_REST):
            state = self.frame(state, contractions, contractions, FRAME)
            if np.abs(state.rates).max() < AT_REST:
                return state
        fastest = np.degrees(np.abs(state.rates).max())
        reason = f"after {LONGEST_REST * FRAME:g} s a joint still turns by {fastest:.2g} deg/s"
        raise ConvergenceError("pseudo muscles", reason)
