"""Inverse kinematics: joint angles within limits that bring bones to targets (Wang 2019, section 6)."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, BoolArray, InputError, RigidTransform
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.joints import Model
from handpipe.skeleton.posing.targets import Target
from handpipe.skeleton.rig.rig import Rig
from handpipe.skeleton.rig.twists import MovingBone, moving_bones

LOG = logging.getLogger(__name__)
Limits = Mapping[str, tuple[float, float]]
STEPS = 200  # of one solve, at most
STEP_TOLERANCE = 1e-9  # rad
SLOW, SMALL = 1e-4, 1e-2  # mm^2 and rad: a step that gains and moves less is the last
AT_LIMIT = 1e-4  # rad; so near to a limit an angle counts as at it
NOTABLE = 0.05  # mm; widening a limit by one degree has to bring this much to be named
BETTER = 0.99  # of the largest distance, which another start has to reach
DAMPING = 1e-3  # first, and least after a step that failed


@dataclass(frozen=True)
class Reach:
    """Angles that inverse kinematics found, and how near they bring the targets.

    Parameters
    ----------
    angles : dict of str to float
        Angles in rad by name, within their limits.
    distances : tuple of float
        Remaining distance of each target in mm; orientations count by their lever.
    at_limits : dict of str to float
        Limits in rad, by angle, that keep the targets from coming nearer.
    tolerance : float
        Distance in mm within which a target is met.
    """

    angles: Angles
    distances: tuple[float, ...]
    at_limits: dict[str, float]
    tolerance: float

    @property
    def reached(self) -> bool:
        """Whether every target is met within the tolerance."""
        return max(self.distances, default=0.0) <= self.tolerance

    def __str__(self) -> str:
        """One line: targets met, or the worst distance in mm and the joint limits that cause it."""
        if self.reached:
            return f"all targets are met within {self.tolerance:g} mm"
        worst = int(np.argmax(self.distances))
        text = f"target {worst + 1} is out of reach: {self.distances[worst]:.2f} mm are left"
        if not self.at_limits:
            return f"{text}; no joint limit holds it, the bones are too short"
        limits = (f"{name} at its limit of {np.degrees(x):.1f} deg" for name, x in self.at_limits.items())
        return f"{text}; limited by {', '.join(limits)}"


@dataclass(frozen=True)
class ReachOptions:
    """How inverse kinematics searches.

    Parameters
    ----------
    rest_weight : float
        Distance in mm that a departure of one rad from rest counts as. It decides what targets leave free.
    tolerance : float
        Distance in mm within which a target is met.
    model : str
        "full", or "partial" without residual motions.
    restarts : bool
        Whether to restart if targets are unmet. Not useful where targets are noisy and the start is near.
    """

    rest_weight: float = 0.1
    tolerance: float = 0.1
    model: Model = "full"
    restarts: bool = True


def solve(
    rig: Rig,
    targets: Sequence[Target],
    *,
    start: Mapping[str, float] | None = None,
    rest: Mapping[str, float] | None = None,
    limits: Limits | None = None,
    root: RigidTransform | None = None,
    options: ReachOptions | None = None,
) -> Reach:
    """Angles of least squared distances from all targets and, weakly, from the rest pose, within limits.

    If targets are unmet from `start`, the search restarts, for the angles that move them, from the middle of
    the limits and from the rig's scanned poses, and the best result is taken: a straight finger may bend the
    wrong way first.

    Parameters
    ----------
    rig : Rig
        Rig that is posed.
    targets : sequence of Target
        Where points or orientations of bones are to be.
    start : mapping of str to float, optional
        Initial angles in rad, by default neutral.
    rest : mapping of str to float, optional
        Angles of the rest pose in rad, by default neutral.
    limits : mapping of str to (float, float), optional
        Limits in rad of the angles whose limits differ from the rig's; equal ones fix an angle.
    root : RigidTransform, optional
        Transform of the root bone from neutral, by default the identity.
    options : ReachOptions, optional
        How to search.

    Returns
    -------
    Reach
        Angles, and the remaining distances.

    Raises
    ------
    InputError
        If a target names an unknown bone, or a lower limit is above its upper one.
    """
    options = options or ReachOptions()
    problem = _Problem.build(rig, targets, rest or {}, limits or {}, root, options)
    values = problem.minimise(problem.vector(start or {}))
    middle = (problem.lower + problem.upper) / 2
    for other in (middle, *(problem.vector(pose.angles) for pose in rig.poses.values())):
        unmet = problem.distances(values) > options.tolerance
        if not (options.restarts and unmet.any()):
            break
        again = problem.minimise(np.where(problem.moved_by(values, unmet), other, values))
        if problem.distances(again).max() < BETTER * problem.distances(values).max():
            values = again
    angles = {name: float(v) for name, v in zip(rig.angle_names, values, strict=True)}
    distances = tuple(float(d) for d in problem.distances(values))
    at_limits = problem.at_limits(values) if max(distances, default=0.0) > options.tolerance else {}
    return Reach(angles, distances, at_limits, options.tolerance)


@dataclass(frozen=True)
class _Problem:
    """Targets as least squares of the angles that may move."""

    rig: Rig
    targets: Sequence[Target]
    rest: Array
    lower: Array
    upper: Array
    root: RigidTransform | None
    options: ReachOptions

    @staticmethod
    def build(
        rig: Rig,
        targets: Sequence[Target],
        rest: Mapping[str, float],
        limits: Limits,
        root: RigidTransform | None,
        options: ReachOptions,
    ) -> _Problem:
        for number, target in enumerate(targets, start=1):
            for bone in target.bones:
                if bone not in rig.bones:
                    remedy = f"The bones are {', '.join(rig.bones)}"
                    raise InputError("inverse kinematics", f"target {number}", f"no bone {bone!r}", remedy)
        every = dict(rig.limits) | dict(limits)
        for name, (low, high) in every.items():
            if name not in rig.limits or not low <= high:
                problem = "is not an angle of this rig" if name not in rig.limits else "lower above upper"
                raise InputError("inverse kinematics", f"limits of {name}", problem, "Correct the limits")
        lower, upper = np.array([every[n] for n in rig.angle_names]).reshape(-1, 2).T
        middle = np.array([rest.get(n, 0.0) for n in rig.angle_names])
        return _Problem(rig, targets, middle, lower, upper, root, options)

    def vector(self, angles: Mapping[str, float]) -> Array:
        """Angles (n,) in the order of the rig, zero where they are not given."""
        return np.array([angles.get(n, 0.0) for n in self.rig.angle_names])

    def moved_by(self, values: Array, chosen: BoolArray) -> BoolArray:
        """Which angles (n,) move any of the chosen targets."""
        bones = self._bones(values)
        rates = [t.residual(bones)[1] for t, c in zip(self.targets, chosen, strict=True) if c]
        return np.abs(np.vstack(rates)).max(axis=0) > 0

    def residual(self, values: Array) -> tuple[Array, Array]:
        """Residuals (k,) of all targets and of the rest pose, in mm, and their derivatives (k, n)."""
        weight = self.options.rest_weight
        bones = self._bones(values)
        found = [target.residual(bones) for target in self.targets]
        residuals = [r for r, _ in found] + [weight * (values - self.rest)]
        return np.concatenate(residuals), np.vstack([*(j for _, j in found), weight * np.eye(len(values))])

    def distances(self, values: Array) -> Array:
        """What each target has left in mm."""
        bones = self._bones(values)
        return np.array([np.linalg.norm(target.residual(bones)[0]) for target in self.targets])

    def minimise(self, start: Array) -> Array:
        """Levenberg and Marquardt's method with projection on the limits (Kanzow et al. 2004) from (n,).

        Angles that the gradient presses against a limit rest there for a step. A step that does not lower
        the cost is damped until it does: heavily damped, it follows the projected gradient.
        """
        values = np.clip(start, self.lower, self.upper)
        residual, jacobian = self.residual(values)
        damping = DAMPING
        for _ in range(STEPS):
            gradient = jacobian.T @ residual
            pressed = (values <= self.lower) & (gradient > 0) | (values >= self.upper) & (gradient < 0)
            free = ~pressed
            normal = jacobian[:, free].T @ jacobian[:, free]
            while True:
                step = np.zeros(len(values))
                damped = normal + damping * np.eye(len(normal)) * max(
                    float(np.trace(normal)) / len(values), 1e-12
                )
                step[free] = -np.linalg.solve(damped, gradient[free])
                trial = np.clip(values + step, self.lower, self.upper)
                moved = float(np.abs(trial - values).max(initial=0.0))
                if moved < STEP_TOLERANCE:
                    return values
                found = self.residual(trial)
                gain = residual @ residual - found[0] @ found[0]
                if gain > 0:
                    break
                damping = max(10 * damping, DAMPING)
            slow = gain < SLOW and moved < SMALL
            values, (residual, jacobian), damping = trial, found, damping / 10
            if slow:
                return values
        LOG.warning("inverse kinematics stopped after %d steps, the last of %.1e rad", STEPS, moved)
        return values

    def at_limits(self, values: Array) -> dict[str, float]:
        """Angles at a limit which, wider by a degree, would bring the targets nearer by more than NOTABLE."""
        bones, gains = self._bones(values), np.zeros(len(values))
        for residual, jacobian in (target.residual(bones) for target in self.targets):
            gains -= np.radians(1) * (residual @ jacobian) / max(float(np.linalg.norm(residual)), 1e-12)
        free = self.upper > self.lower  # an angle that the caller fixes is not at a limit of the joint
        low = free & (values <= self.lower + AT_LIMIT) & (gains < -NOTABLE)
        high = free & (values >= self.upper - AT_LIMIT) & (gains > NOTABLE)
        return {n: float(values[i]) for i, n in enumerate(self.rig.angle_names) if low[i] or high[i]}

    def _bones(self, values: Array) -> dict[str, MovingBone]:
        angles = dict(zip(self.rig.angle_names, values, strict=True))
        return moving_bones(self.rig, angles, self.root, self.options.model)
