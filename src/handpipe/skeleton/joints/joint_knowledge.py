"""How far a joint's axes and centre may be off, and whether its poses determine them or its hints alone do.

A pose determines the tilt of an axis by the part of the motion that no change of the joint's angles explains.
These observations are combined with the prior of the dataset's hints (`prior.PRIOR`). The posterior's
standard deviations are given, and parameters that the poses determine less than the prior are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray, RigidTransform
from handpipe.skeleton.joints.joints import JointFit, axes_apart, leftover
from handpipe.skeleton.joints.prior import PRIOR, MotionNoise, rotation_noise, translation_noise, unexplained

ASSUMED = MotionNoise(float(np.radians(0.3)), 0.1)  # rad and mm, of a motion whose noise is not given
TOLD = np.sqrt(0.5)  # of the prior's deviation: below, poses determine more than the hint


@dataclass(frozen=True)
class JointKnowledge:
    """Standard deviations of a fitted joint in the direction that is known least.

    What does not change the motion does not count: the centre along a hinge's axis, and a ball joint's axes,
    which only name its angles.

    Parameters
    ----------
    poses : int
        Number of motions to which the joint was fitted.
    axes : array (dof,)
        Standard deviation of the tilt of each axis in rad.
    axes_told : array (dof,) of bool
        Whether the poses determine each axis more than its hint.
    centre : float
        Standard deviation of the centre in mm.
    centre_told : bool
        Whether the poses determine the centre more than the prior.
    """

    poses: int
    axes: Array
    axes_told: BoolArray
    centre: float
    centre_told: bool

    @staticmethod
    def assess(
        fit: JointFit, relative: Sequence[RigidTransform], noise: Sequence[MotionNoise] | None = None
    ) -> JointKnowledge:
        """Of a joint fitted to motions (n) from neutral with the given noise."""
        count, dof = len(relative), fit.dof
        if dof == 0:
            return JointKnowledge(count, np.zeros(0), np.ones(0, bool), 0.0, True)
        measured = [ASSUMED] * count if noise is None else noise
        axes = _axis_deviations(fit, relative, rotation_noise(measured))
        centre = _centre_deviation(fit, relative, translation_noise(measured))
        told = axes <= TOLD * PRIOR.tilt * (1 + 1e-9)
        return JointKnowledge(count, axes, told, centre, bool(centre <= TOLD * PRIOR.centre))

    def doubts(self, names: Sequence[str]) -> list[str]:
        """What the poses do not determine of a joint, in words.

        Parameters
        ----------
        names : sequence of str
            Names of the joint's angles.

        Returns
        -------
        list of str
            Undetermined axes and centre; empty if the poses determine all.
        """
        found = [
            f"the axis of {name} keeps its hint (deviation {np.degrees(deviation):.0f} deg)"
            for name, told, deviation in zip(names, self.axes_told, self.axes, strict=True)
            if not told
        ]
        if not self.centre_told:
            found.append(f"its centre is guessed from the gap of its bones (deviation {self.centre:.1f} mm)")
        return found


def _axis_deviations(fit: JointFit, relative: Sequence[RigidTransform], noise: Array) -> Array:
    """Of each axis (dof,) in rad, in the direction in which it may be tilted most."""
    if fit.type == "ball":
        return np.zeros(fit.dof)
    tilts = _tilts(fit)  # (dof, 3, m): what the parameters do to each axis
    precision = np.eye(tilts.shape[2]) / PRIOR.tilt**2
    if relative:
        left = leftover(fit.axes, np.array([t.rotation for t in relative]))
        size = np.linalg.norm(left, axis=1, keepdims=True) / np.sqrt(3 - fit.dof) * np.ones((1, 3 - fit.dof))
        more = unexplained(size, noise, tilts.shape[2], PRIOR.rotation, PRIOR.poses)
        for angles, deviation in zip(fit.angles, np.hypot(noise, more), strict=True):
            seen = unexplained_part(_turns(fit, angles, tilts), fit.axes.rates(angles).T) / deviation
            precision = precision + seen.T @ seen
    covariance = np.linalg.inv(precision)
    return np.array([_largest(t @ covariance @ t.T) for t in tilts])


def _tilts(fit: JointFit) -> Array:
    """Tilts (dof, 3, m) of the axes by m parameters: orthogonal axes tilt together, others each alone.

    A turn of an axis about itself is none.
    """
    across = [np.eye(3) - np.outer(a, a) for a in fit.axes.directions]
    if fit.type != "saddle":
        return np.array(across)
    none = np.zeros((3, 3))
    return np.array([np.hstack([across[0], none]), np.hstack([none, across[1]])])


def _turns(fit: JointFit, angles: Array, tilts: Array) -> Array:
    """Turn (3, m) of the motion by the parameters: a tilt t of an axis turns its rotation R by t - R t."""
    total, before = np.zeros(tilts.shape[1:]), np.eye(3)
    for i in fit.axes.order:
        only = np.where(np.arange(fit.dof) == i, angles, 0.0)
        rotation = fit.axes.rotation(only)
        total = total + before @ (np.eye(3) - rotation) @ tilts[i]
        before = before @ rotation
    return total


def _centre_deviation(fit: JointFit, relative: Sequence[RigidTransform], noise: Array) -> float:
    """In mm, in the direction that counts and is known least."""
    across = _directions_that_count(fit)
    extra = 1 if fit.type == "saddle" else 0
    precision = np.eye(across.shape[1] + extra) / PRIOR.centre**2
    if relative:
        shift = fit.translation_residual(fit.angles)
        more = unexplained(shift, noise, 3 + extra, PRIOR.translation, PRIOR.poses)
        for t, angles, deviation in zip(relative, fit.angles, np.hypot(noise, more), strict=True):
            seen = (np.eye(3) - t.rotation) @ across
            if extra:
                normal = np.cross(*fit.axes.directions[list(fit.axes.order)])
                normal = normal / np.linalg.norm(normal)
                seen = np.column_stack([seen, axes_apart(fit.axes, angles) @ normal])
            precision = precision + seen.T @ seen / deviation**2
    return _largest(np.asarray(np.linalg.inv(precision), float))


def _directions_that_count(fit: JointFit) -> Array:
    """Directions (3, k) in which the centre's place changes the joint's motion."""
    if fit.dof > 1:
        return np.eye(3)
    return np.linalg.svd(fit.axes.directions)[2][1:].T


def unexplained_part(columns: Array, explained: Array) -> Array:
    """Columns (m, p) without what other columns (m, k) explain."""
    q, _ = np.linalg.qr(explained)
    return np.asarray(columns - q @ (q.T @ columns))


def _largest(covariance: Array) -> float:
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))
