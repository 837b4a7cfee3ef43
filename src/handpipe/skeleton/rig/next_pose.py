"""Which pose to scan next: the one that leaves least uncertainty in the rig over the range of motion.

Around the rig as it is, a joint's motion is linear in small changes of its parameters: the tilt of its axes,
its centre, and the coefficients of its residual motion. A scanned pose measures that motion with the noise of
registration, but not the joint's angles, which are found with it; what a change of angles can explain carries
no information. The posterior covariance of the parameters after a pose does not depend on what the scan will
show, so that poses can be ranked before they are scanned (I-optimal design).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array
from handpipe.skeleton.joints.angles import Angles
from handpipe.skeleton.joints.joint_tree import RigJoint
from handpipe.skeleton.joints.residual import features
from handpipe.skeleton.rig.rig import Rig

SAMPLES = {1: 9, 2: 5, 3: 4}  # values of each angle over its range


@dataclass(frozen=True)
class Knowledge:
    """Standard deviations of what is known before any pose, and of a registration.

    Parameters
    ----------
    rotation_noise, translation_noise : float
        Of a bone's registration at its centroid, in rad and mm.
    tilt : float
        Of the axes guessed from the bones alone, in rad.
    centre : float
        Of the centre guessed from the bones alone, in mm.
    rotation, translation : float
        Of the coefficients of the residual motion, in rad and mm.
    """

    rotation_noise: float = float(np.radians(0.3))
    translation_noise: float = 0.1
    tilt: float = 0.3
    centre: float = 5.0
    rotation: float = 0.05
    translation: float = 0.5


@dataclass(frozen=True)
class JointUncertainty:
    """How well a joint's parameters are known, and what that means for its motion.

    Parameters
    ----------
    joint : RigJoint
        The joint.
    point : array (3,)
        Neutral point at which its motion is measured, mm.
    precision : array (p, p)
        Inverse covariance of the joint's parameters.
    spread : array (p, p)
        Mean over the range of motion of the squared displacement, in mm^2, of what the joint carries, as a
        quadratic form of the parameters, each angle at its best.
    share : float
        Share of all the rig's bones that the joint carries.
    """

    joint: RigJoint
    point: Array
    precision: Array
    spread: Array
    share: float

    @property
    def variance(self) -> float:
        """Expected mean squared displacement in mm^2 of what the joint carries."""
        return float(np.trace(np.linalg.solve(self.precision, self.spread)))


@dataclass(frozen=True)
class RigUncertainty:
    """How far the rig's bones are expected to be off, from the poses that it has seen so far."""

    joints: tuple[JointUncertainty, ...]
    knowledge: Knowledge

    @staticmethod
    def of_rig(
        rig: Rig, poses: Mapping[str, Angles] | None = None, knowledge: Knowledge | None = None
    ) -> RigUncertainty:
        """After the given poses (angles in rad by pose), those of the rig if None."""
        knowledge = knowledge or Knowledge()
        seen = {n: p.known for n, p in rig.poses.items()} if poses is None else poses
        joints = tuple(_before(rig, joint, knowledge) for joint in rig.joints if joint.angles)
        uncertainty = RigUncertainty(joints, knowledge)
        for angles in seen.values():
            uncertainty = uncertainty.after(angles)
        return uncertainty

    @property
    def error(self) -> float:
        """Expected root mean square displacement in mm of the bones over the range of motion.

        The errors of a chain's joints add up in its last bones.
        """
        return float(np.sqrt(sum(j.share * j.variance for j in self.joints)))

    def by_joint(self) -> dict[str, float]:
        """Joint -> root mean square displacement in mm of what it carries, by its own uncertainty."""
        return {j.joint.name: float(np.sqrt(j.variance)) for j in self.joints}

    def after(self, angles: Mapping[str, float]) -> RigUncertainty:
        """The uncertainty once a pose of these angles (rad) has been scanned.

        A joint of which an angle is not among them gains nothing: the pose lacks one of its bones.
        """
        joints = []
        for j in self.joints:
            if any(n not in angles for n in j.joint.angles):
                joints.append(j)
                continue
            values = np.array([angles[n] for n in j.joint.angles])
            gained = _information(j.joint, values, j.point, self.knowledge)
            joints.append(JointUncertainty(j.joint, j.point, j.precision + gained, j.spread, j.share))
        return RigUncertainty(tuple(joints), self.knowledge)


def rank_poses(uncertainty: RigUncertainty, candidates: Mapping[str, Angles]) -> list[tuple[str, float]]:
    """Candidates (angles in rad by name), the best first, each with the error in mm that it would leave."""
    errors = {name: uncertainty.after(angles).error for name, angles in candidates.items()}
    return sorted(errors.items(), key=lambda item: item[1])


def plan_poses(
    uncertainty: RigUncertainty, candidates: Mapping[str, Angles], count: int
) -> list[tuple[str, float]]:
    """The next `count` poses in the order to scan them, each with the error in mm that is left after it."""
    left, plan = dict(candidates), []
    for _ in range(min(count, len(left))):
        name, error = rank_poses(uncertainty, left)[0]
        uncertainty = uncertainty.after(left.pop(name))
        plan.append((name, error))
    return plan


def _before(rig: Rig, joint: RigJoint, knowledge: Knowledge) -> JointUncertainty:
    """A joint of which no pose has been seen."""
    carried = _carried(rig, joint.child)
    points = np.concatenate([rig.surfaces[b].vertices for b in carried])
    centroid = rig.surfaces[joint.child].vertices.mean(axis=0)
    samples = _range_of_motion(joint)
    k = features(samples[:1], *joint.limits.T).shape[1]
    k_ = knowledge
    deviations = [k_.tilt] * 3 + [k_.centre] * 3 + [k_.rotation] * (3 * k) + [k_.translation] * (3 * k)
    spread = np.mean([_spread(joint, values, points) for values in samples], axis=0)
    share = len(carried) / max(len(rig.joints), 1)
    return JointUncertainty(joint, centroid, np.diag(np.array(deviations) ** -2.0), spread, share)


def _carried(rig: Rig, bone: str) -> list[str]:
    """A bone and all its descendants."""
    return [bone, *(b for j in rig.joints if j.parent == bone for b in _carried(rig, j.child))]


def _range_of_motion(joint: RigJoint) -> Array:
    """Angles (n, dof) in rad spread over a joint's limits."""
    axes = [np.linspace(lower, upper, SAMPLES[joint.fit.dof]) for lower, upper in joint.limits]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, joint.fit.dof)


def _sensitivity(joint: RigJoint, values: Array, point: Array) -> tuple[Array, Array]:
    """Turn (rad) and displacement (mm) of a neutral point (3,) by the parameters (6, p) and angles (6, dof).

    A tilt t of the axes turns the motion by t - R t; a shift c of the centre moves all by c - R c.
    """
    rotation = joint.fit.axes.rotation(values)
    arm = rotation @ (point - joint.fit.centre)
    across = -np.cross(np.eye(3), arm)  # across.T @ w is the velocity of the point under the turn w
    still = np.eye(3) - rotation
    terms = np.kron(features(values[None], *joint.limits.T), np.eye(3))
    none = np.zeros_like(terms)
    turn = np.hstack([still, np.zeros((3, 3)), terms, none])
    shift = np.hstack([np.zeros((3, 3)), still, none, terms]) + across @ turn
    rates = joint.fit.axes.rates(values).T
    return np.vstack([turn, shift]), np.vstack([rates, across @ rates])


def _information(joint: RigJoint, values: Array, point: Array, knowledge: Knowledge) -> Array:
    """Information (p, p) of a scanned pose on the parameters, its angles unknown."""
    parameters, angles = _sensitivity(joint, values, point)
    weights = 1 / np.repeat([knowledge.rotation_noise, knowledge.translation_noise], 3)
    return _unexplained(weights[:, None] * parameters, weights[:, None] * angles)


def _spread(joint: RigJoint, values: Array, points: Array) -> Array:
    """Mean squared displacement of points (n, 3) as a quadratic form (p, p), the angles at their best."""
    parameters, angles = _sensitivity(joint, values, points.mean(axis=0))
    lengths, directions = np.linalg.eigh(np.cov(points.T, bias=True))
    rotation = joint.fit.axes.rotation(values)
    arms = (rotation @ directions) * np.sqrt(np.maximum(lengths, 0))
    # Under a small turn the ends of the cloud's half axes move by the turn x arm.
    turned = np.vstack([-np.cross(np.eye(3), arm) for arm in arms.T])

    def displacement(columns: Array) -> Array:
        return np.vstack([turned @ columns[:3], columns[3:]])

    return _unexplained(displacement(parameters), displacement(angles))


def _unexplained(columns: Array, explained: Array) -> Array:
    """Normal matrix of columns (m, p) with what other columns (m, dof) explain taken out."""
    q, _ = np.linalg.qr(explained)
    rest = columns - q @ (q.T @ columns)
    return rest.T @ rest
