"""One joint of the bone rig: axes, centre and residual motion from poses (Wang 2019, section 4)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handpipe.mesh.rigid import RigidTransform
from handpipe.skeleton.axes import Axes, fit_axes, fit_oblique_axes, three_axes
from handpipe.skeleton.residual import Residual, fit_residual

Array = NDArray[np.float64]
Model = Literal["full", "partial"]
JointType = Literal["rigid", "hinge", "universal", "saddle", "ball"]
Errors = tuple[Array, Array]
DEGREES: dict[JointType, int] = {"rigid": 0, "hinge": 1, "universal": 2, "saddle": 2, "ball": 3}
DEFAULT_TYPES: dict[int, JointType] = {0: "rigid", 1: "hinge", 2: "universal", 3: "ball"}
HARDLY_MOVED = 0.035  # about two degrees a pose: what moves less tells no more than the noise of registration


@dataclass(frozen=True)
class JointFit:
    """X -> R^(phi) R(phi) (X - C) + C + x^(phi) (Wang 2019, Eq. 2), in the neutral frame, parent at rest.

    centre C (3,) in mm; rotation_residual gives the rotation vector of R^ in rad, translation_residual x^
    in mm; angles (n, dof) in rad: the fitted angles of the poses it was fitted to. offset (3,) in mm: from C
    on the axis that turns first to a point of the axis that turns second, where the two do not meet (saddle).
    """

    axes: Axes
    centre: Array
    rotation_residual: Residual
    translation_residual: Residual
    angles: Array
    offset: Array = field(default_factory=lambda: np.zeros(3))

    @property
    def dof(self) -> int:
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


def fit_joint(
    relative: Sequence[RigidTransform],
    dof: int,
    axis_hints: Array,
    *,
    near: Array | None = None,
    joint_type: JointType | None = None,
) -> JointFit:
    """Fit a joint to motions of the child relative to the parent, from neutral, in the neutral frame.

    dof: 0 to 3; without a degree of freedom the bones move as one. axis_hints (dof, 3): rough axes that
    fix the signs. near (3,): a point near the joint; it fixes the centre where the motions leave it
    undetermined, along the axis of a one-axis joint. joint_type: one of that many degrees of freedom, by
    default `DEFAULT_TYPES`. Neutral need not be among `relative`: it is the zero of every function.
    """
    hints = np.asarray(axis_hints, float).reshape(-1, 3)
    joint_type = joint_type or DEFAULT_TYPES[dof]
    if hints.shape != (dof, 3) or DEGREES[joint_type] != dof:
        raise ValueError(f"axis_hints of shape {hints.shape}, not {(dof, 3)}, for a {joint_type} joint")
    start = np.zeros(3) if near is None else near
    if joint_type == "rigid":
        nothing = Residual(np.zeros((0, 3)), np.zeros(0), np.zeros(0))
        return JointFit(Axes(np.zeros((0, 3)), ()), start, nothing, nothing, np.zeros((len(relative), 0)))
    rotations = np.array([t.rotation for t in relative])
    offset = np.zeros(3)
    if joint_type == "saddle":
        axes = fit_oblique_axes(rotations, hints)
        centre, offset = fit_apart(axes, relative, start)
    else:
        axes = three_axes(hints) if joint_type == "ball" else fit_axes(rotations, hints)
        centre = fit_centre(relative, dof, start)
    angles, rotation, translation = _residuals(axes, centre, offset, relative)
    return JointFit(
        axes, centre, fit_residual(angles, rotation), fit_residual(angles, translation), angles, offset
    )


def axes_apart(axes: Axes, angles: Array) -> Array:
    """Matrix (3, 3) from the offset of the second axis to what it adds to the motion: A (I - B)."""
    first, second = (Rotation.from_rotvec(angles[i] * axes.directions[i]).as_matrix() for i in axes.order)
    return first @ (np.eye(3) - second)


def fit_apart(axes: Axes, relative: Sequence[RigidTransform], near: Array) -> tuple[Array, Array]:
    """Centre (3,) on the first axis and offset (3,) to the second, by least squares of Eq. 3 for two axes.

    Points may slide along their axes: the offset is taken along the common perpendicular.
    """
    across = np.cross(*axes.directions[list(axes.order)])
    across = across / np.linalg.norm(across)
    angles = axes.nearest(np.array([t.rotation for t in relative]))
    a = np.vstack([t.rotation - np.eye(3) for t in relative])
    d = np.concatenate([axes_apart(axes, values) @ across for values in angles])
    b = np.concatenate([t(near) - near for t in relative])
    system = np.column_stack([-a, d])
    # Directions that the motions hardly tell stay at the start: no offset, the centre near the joint.
    u, values, vt = np.linalg.svd(system, full_matrices=False)
    keep = values > HARDLY_MOVED * np.sqrt(len(relative))
    found = vt[keep].T @ ((u[:, keep].T @ b) / values[keep])
    return near + found[:3], found[3] * across


def left_jacobian(vector: Array) -> Array:
    """Matrix (3, 3) from the rate of a rotation vector (3,) to the angular velocity of its rotation."""
    angle = float(np.linalg.norm(vector))
    x = np.cross(np.eye(3), vector)  # x @ y is the cross product of vector and y
    if angle < 1e-4:  # the next terms of the series are below 1e-9
        return np.eye(3) + x / 2 + x @ x / 6
    return np.eye(3) + (1 - np.cos(angle)) / angle**2 * x + (angle - np.sin(angle)) / angle**3 * x @ x


def leave_one_out(
    relative: Sequence[RigidTransform],
) -> Iterator[tuple[list[RigidTransform], RigidTransform]]:
    """Every split into one motion and the rest; none where the rest would be empty."""
    if len(relative) > 1:
        for i, left in enumerate(relative):
            yield [t for j, t in enumerate(relative) if j != i], left


def fit_centre(relative: Sequence[RigidTransform], dof: int, near: Array) -> Array:
    """Centre C (3,) that minimises sum |x_i + (R_i - I) C|^2 (Wang 2019, Eq. 3).

    A one-axis joint leaves C free along its axis, and a two-axis joint whose second axis hardly moved
    nearly so: there C stays at `near`.
    """
    a = np.concatenate([t.rotation - np.eye(3) for t in relative])
    b = np.concatenate([t(near) - near for t in relative])
    _, values, vt = np.linalg.svd(a, full_matrices=False)
    keep = (values > HARDLY_MOVED * np.sqrt(len(relative))) & (np.arange(3) < dof + 1)
    directions = vt[keep].T
    return near - directions @ np.linalg.lstsq(a @ directions, b, rcond=None)[0]


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
