"""One joint of the bone rig: axes, centre and residual motion from poses (Wang 2019, section 4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from handpipe.core import Array, RigidTransform, left_jacobian
from handpipe.skeleton.joints.axes import Axes, fit_axes, fit_oblique_axes, orthogonal_hints, three_axes
from handpipe.skeleton.joints.prior import (
    PRIOR,
    MotionNoise,
    Weighing,
    rotation_noise,
    translation_noise,
    unexplained,
)
from handpipe.skeleton.joints.residual import Residual, features, fit_residual

Model = Literal["full", "partial"]
JointType = Literal["rigid", "hinge", "universal", "saddle", "ball"]
Errors = tuple[Array, Array]
T = TypeVar("T")
DEGREES: dict[JointType, int] = {"rigid": 0, "hinge": 1, "universal": 2, "saddle": 2, "ball": 3}
DEFAULT_TYPES: dict[int, JointType] = {0: "rigid", 1: "hinge", 2: "universal", 3: "ball"}
HARDLY_MOVED = 0.035  # rad, about two degrees a pose: smaller motions are within the noise of registration


@dataclass(frozen=True)
class JointFit:
    """A fitted joint: the motion of its child at given angles.

    The motion is X -> R^(phi) R(phi) (X - C) + C + x^(phi), in the neutral frame with the parent at rest.

    Parameters
    ----------
    axes : Axes
        Axes of R(phi).
    centre : array (3,)
        Centre C in mm.
    rotation_residual : Residual
        Rotation vector of R^ in rad as a function of the angles.
    translation_residual : Residual
        x^ in mm as a function of the angles.
    angles : array (n, dof)
        Angles in rad of the poses to which the joint was fitted.
    offset : array (3,)
        From C, on the axis that turns first, to a point of the axis that turns second, in mm. Zero unless the
        two do not meet (saddle).

    References
    ----------
    Wang 2019 §4, Eq. 2.
    """

    axes: Axes
    centre: Array
    rotation_residual: Residual
    translation_residual: Residual
    angles: Array
    offset: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, 0 to 3."""
        return self.axes.dof

    @property
    def type(self) -> JointType:
        """What the joint is, by its axes and its offset."""
        if self.dof == 2 and (
            self.offset.any() or abs(self.axes.directions[0] @ self.axes.directions[1]) > 1e-6
        ):
            return "saddle"
        return DEFAULT_TYPES[self.dof]

    def transform(self, angles: Array, model: Model = "full") -> RigidTransform:
        """Motion of the child relative to the parent at angles (dof,) in rad; "partial" has no residuals."""
        about = RigidTransform.about(self.centre, self.axes.rotation(angles))
        if self.offset.any():
            about = RigidTransform(np.eye(3), axes_apart(self.axes, angles) @ self.offset) @ about
        if model == "partial":
            return about
        small = Rotation.from_rotvec(self.rotation_residual(angles)[0]).as_matrix()
        return RigidTransform(np.eye(3), self.translation_residual(angles)[0]) @ (
            RigidTransform.about(self.centre, small) @ about
        )

    def twists(self, angles: Array, model: Model = "full") -> tuple[Array, Array]:
        """Angular velocities w (dof, 3) and velocities v (dof, 3) of the child for a unit rate of each angle.

        A point at x, after the motion, moves with w x + v (cross product), in 1 and mm per rad. Eq. 2 turns
        about C + x^, and that point moves with the derivative of x^; R^ adds its own angular velocity,
        which the left Jacobian of the rotation vector gives. The second axis of a saddle passes C at a
        distance, so that C itself moves.
        """
        w = self.axes.rates(angles)
        at_centre = np.zeros((self.dof, 3))  # velocity of what is at C
        if self.offset.any():
            first, second = self.axes.order
            turned = Rotation.from_rotvec(angles[first] * self.axes.directions[first])
            at_centre[second] = -np.cross(w[second], turned.apply(self.offset))
        if model == "partial":
            return w, at_centre - np.cross(w, self.centre)
        small = self.rotation_residual(angles)[0]
        rotation = Rotation.from_rotvec(small).as_matrix()
        w = w @ rotation.T + self.rotation_residual.rates(angles) @ left_jacobian(small).T
        about = self.centre + self.translation_residual(angles)[0]
        moved = self.translation_residual.rates(angles) + at_centre @ rotation.T
        return w, moved - np.cross(w, about)

    def angles_of(self, relative: Sequence[RigidTransform]) -> Array:
        """Angles (n, dof) in rad whose rotations about the axes are nearest to the motions (Eq. 1, Eq. 4)."""
        return self.axes.nearest(np.array([t.rotation for t in relative]))

    def errors(self, relative: Sequence[RigidTransform], point: Array, model: Model = "full") -> Errors:
        """Rotation errors (n,) in rad, and errors (n,) in mm of a point (3,) of the neutral child."""
        found = [self.transform(a, model) for a in self.angles_of(relative)]
        rotation = [f.angle_to(t) for f, t in zip(found, relative, strict=True)]
        shift = [np.linalg.norm(f(point) - t(point)) for f, t in zip(found, relative, strict=True)]
        return np.array(rotation), np.array(shift)

    def place_errors(self, relative: Sequence[RigidTransform], points: Array, model: Model = "full") -> Array:
        """Root mean square distances (n,) in mm of the child's points (k, 3) from their true places."""
        found = [self.transform(a, model) for a in self.angles_of(relative)]
        apart = np.array([f(points) - t(points) for f, t in zip(found, relative, strict=True)])
        return np.asarray(np.sqrt((apart.reshape(-1, len(points), 3) ** 2).sum(axis=2).mean(axis=1)))


def fit_joint(
    relative: Sequence[RigidTransform],
    dof: int,
    axis_hints: Array,
    *,
    near: Array | None = None,
    joint_type: JointType | None = None,
    noise: Sequence[MotionNoise] | None = None,
) -> JointFit:
    """A joint fitted to motions of the child relative to the parent.

    Neutral need not be among the motions: it is the zero of every function. Without any motion the joint has
    the axes of its hints, its centre at `near`, and no residual motion.

    Parameters
    ----------
    relative : sequence of RigidTransform
        Motions from neutral, one a pose, in the neutral frame (mm).
    dof : int
        Number of degrees of freedom, 0 to 3. With 0 the bones move as one.
    axis_hints : array (dof, 3)
        Rough axes, which fix the signs.
    near : array (3,), optional
        Point near the joint in mm, by default the origin. It fixes the centre where the motions leave it
        undetermined, as along the axis of a one-axis joint.
    joint_type : str, optional
        Type with `dof` degrees of freedom, by default that of `DEFAULT_TYPES`.
    noise : sequence of MotionNoise, optional
        Standard deviations of each motion. With them, motions are weighted accordingly, and the hints and
        `near` count as far as the motions leave doubt (`prior.PRIOR`). Without them, the motions alone
        decide.

    Returns
    -------
    JointFit
        Axes, centre and residual motions.

    Raises
    ------
    ValueError
        If the hints or the type do not agree with `dof`.
    """
    hints = np.asarray(axis_hints, float).reshape(-1, 3)
    joint_type = joint_type or DEFAULT_TYPES[dof]
    if hints.shape != (dof, 3) or DEGREES[joint_type] != dof:
        raise ValueError(f"axis_hints of shape {hints.shape}, not {(dof, 3)}, for a {joint_type} joint")
    start = np.zeros(3) if near is None else near
    if dof and not relative:
        return _unseen(hints, start, joint_type)
    if joint_type == "rigid":
        nothing = Residual(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
        return JointFit(Axes(np.zeros((0, 3)), ()), start, nothing, nothing, np.zeros((len(relative), 0)))
    axes, turning = _weighed_axes(np.array([t.rotation for t in relative]), hints, joint_type, noise)
    centre, offset, shifting = _weighed_centre(axes, relative, joint_type, start, noise)
    angles, rotation, translation = _residuals(axes, centre, offset, relative)
    return JointFit(
        axes,
        centre,
        fit_residual(angles, rotation, turning.weights),
        fit_residual(angles, translation, shifting.weights),
        angles,
        offset,
    )


def _unseen(hints: Array, near: Array, joint_type: JointType) -> JointFit:
    """A joint of which no motion was seen."""
    dof = len(hints)
    directions = hints / np.linalg.norm(hints, axis=1, keepdims=True)
    if joint_type != "saddle":
        directions = orthogonal_hints(hints)
    terms = features(np.zeros((1, dof)), np.zeros(dof), np.zeros(dof)).shape[1]
    nothing = Residual(np.zeros((terms, 3)), np.zeros(dof), np.zeros(dof))
    return JointFit(Axes(directions, tuple(range(dof))), near, nothing, nothing, np.zeros((0, dof)))


def _weighed_axes(
    rotations: Array, hints: Array, joint_type: JointType, noise: Sequence[MotionNoise] | None
) -> tuple[Axes, Weighing]:
    """Axes, in two rounds where noise is given: the first one tells how much they leave unexplained."""

    def fit(weighing: Weighing) -> Axes:
        if joint_type == "ball":
            return three_axes(hints)
        return (fit_oblique_axes if joint_type == "saddle" else fit_axes)(rotations, hints, weighing)

    weighing = Weighing.plain(len(rotations))
    if noise is None or joint_type == "ball":
        return fit(weighing), weighing
    measured, more = rotation_noise(noise), PRIOR.rotation
    for _ in range(2):
        weighing = Weighing.from_deviations(measured, more, PRIOR.tilt)
        axes = fit(weighing)
        # What is left of a turn has no part about the axes themselves.
        left = leftover(axes, rotations)
        free = 3 - axes.dof
        size = np.linalg.norm(left, axis=1, keepdims=True) / np.sqrt(free) * np.ones((1, free))
        more = unexplained(size, measured, {"hinge": 2, "universal": 3, "saddle": 4}[joint_type],
                           PRIOR.rotation, PRIOR.poses)  # fmt: skip
    return axes, weighing


def _weighed_centre(
    axes: Axes,
    relative: Sequence[RigidTransform],
    joint_type: JointType,
    near: Array,
    noise: Sequence[MotionNoise] | None,
) -> tuple[Array, Array, Weighing]:
    """Centre (3,) and offset (3,), in two rounds where noise is given, as the axes."""

    def fit(weighing: Weighing) -> tuple[Array, Array]:
        if joint_type == "saddle":
            return fit_apart(axes, relative, near, weighing)
        return fit_centre(relative, axes.dof, near, weighing), np.zeros(3)

    weighing = Weighing.plain(len(relative))
    if noise is None:
        return *fit(weighing), weighing
    measured, more = translation_noise(noise), PRIOR.translation
    for _ in range(2):
        weighing = Weighing.from_deviations(measured, more, PRIOR.centre)
        centre, offset = fit(weighing)
        shift = _residuals(axes, centre, offset, relative)[2]
        more = unexplained(
            shift, measured, 4 if joint_type == "saddle" else 3, PRIOR.translation, PRIOR.poses
        )
    return centre, offset, weighing


def leftover(axes: Axes, rotations: Array) -> Array:
    """Rotation vectors (n, 3) in rad of what the best angles about the axes leave of rotations (n, 3, 3)."""
    nearest = np.array([axes.rotation(a) for a in axes.nearest(rotations)])
    return Rotation.from_matrix(rotations @ nearest.transpose(0, 2, 1)).as_rotvec()


def axes_apart(axes: Axes, angles: Array) -> Array:
    """Matrix (3, 3) from the offset of the second axis to what it adds to the motion: A (I - B)."""
    first, second = (Rotation.from_rotvec(angles[i] * axes.directions[i]).as_matrix() for i in axes.order)
    return first @ (np.eye(3) - second)


def fit_apart(
    axes: Axes, relative: Sequence[RigidTransform], near: Array, weighing: Weighing | None = None
) -> tuple[Array, Array]:
    """Centre (3,) on the first axis and offset (3,) to the second, by least squares of Eq. 3 for two axes.

    Points may slide along their axes: the offset is taken along the common perpendicular.
    """
    across = np.cross(*axes.directions[list(axes.order)])
    across = across / np.linalg.norm(across)
    angles = axes.nearest(np.array([t.rotation for t in relative]))
    a = np.vstack([t.rotation - np.eye(3) for t in relative])
    d = np.concatenate([axes_apart(axes, values) @ across for values in angles])
    b = np.concatenate([t(near) - near for t in relative])
    found = _determined(np.column_stack([-a, d]), b, 4, weighing or Weighing.plain(len(relative)))
    return near + found[:3], found[3] * across


def _determined(system: Array, right: Array, rank: int, weighing: Weighing) -> Array:
    """Least squares of system (3 n, p) for right (3 n,), in the directions of largest motion, `rank` at most.

    Without a prior, directions that the motions hardly determine stay zero: no offset, the centre near the
    joint.
    """
    weights = np.repeat(weighing.weights, 3)
    u, values, vt = np.linalg.svd(weights[:, None] * system, full_matrices=False)
    least = HARDLY_MOVED * np.sqrt(len(weighing.weights)) if weighing.pull == 0 else 0.0
    keep = (values > least) & (np.arange(len(values)) < rank)
    u, values, vt = u[:, keep], values[keep], vt[keep]
    return vt.T @ (values / (values**2 + weighing.pull**2) * (u.T @ (weights * right)))


def leave_one_out(items: Sequence[T]) -> Iterator[tuple[list[T], T]]:
    """Every split into one item and the rest; none where the rest would be empty."""
    if len(items) > 1:
        for i, left in enumerate(items):
            yield [t for j, t in enumerate(items) if j != i], left


def fit_centre(
    relative: Sequence[RigidTransform], dof: int, near: Array, weighing: Weighing | None = None
) -> Array:
    """Centre C (3,) that minimises sum |x_i + (R_i - I) C|^2 (Wang 2019, Eq. 3).

    A one-axis joint leaves C free along its axis, and a two-axis joint whose second axis hardly moved
    nearly so: there C stays at `near`.
    """
    a = np.concatenate([t.rotation - np.eye(3) for t in relative])
    b = np.concatenate([t(near) - near for t in relative])
    return near - _determined(a, b, dof + 1, weighing or Weighing.plain(len(relative)))


def _residuals(
    axes: Axes, centre: Array, offset: Array, relative: Sequence[RigidTransform]
) -> tuple[Array, Array, Array]:
    """Angles (n, dof), rotation vectors of R_i R(phi_i)^T (n, 3), and x_i + (R_i - I) C (n, 3).

    What the axes' distance moves (saddle) is no residual.
    """
    rotations = np.array([t.rotation for t in relative])
    angles = axes.nearest(rotations)
    small = [r @ axes.rotation(a).T for r, a in zip(rotations, angles, strict=True)]
    translation = np.array([t(centre) - centre for t in relative])
    if offset.any():
        turned = Rotation.from_matrix(np.array(small)).as_matrix()
        apart = np.array([axes_apart(axes, values) @ offset for values in angles])
        translation = translation - np.einsum("nij,nj->ni", turned, apart)
    return angles, Rotation.from_matrix(np.array(small)).as_rotvec(), translation
