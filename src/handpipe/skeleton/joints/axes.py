"""Rotation axes of a joint from relative rotations of its child bone (Wang 2019, Eq. 1, 4 and 5).

For fixed axes the best angles are closed form. One axis: the dot product of a unit quaternion (w, v) with a
rotation about `a` is at most sqrt(w^2 + (v.a)^2). Two orthogonal axes, columns of a frame in which the
quaternion reads (w, x, y, z): it is at most the larger singular value of [[w, y], [x, z]], whose singular
vectors are the cosines and sines of the half angles. The difference of the best dot product s from one is
written as a square, 2 (1 - s) = |residual|^2, so that least squares maximise Eq. 1 or 4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from handpipe.core import Array
from handpipe.skeleton.joints.prior import Weighing

TOLERANCE = 1e-13  # of parameters, cost and gradient
ORDERS = ((0, 1), (1, 0))  # of two axes: which one is outer
SAME = 1e-6  # relative difference of two fits' residuals; 1e-6 rad where the residuals vanish
HINT_WEIGHT = 1e-8  # in squared half angles: hints count where all motion is below 0.01 degrees
PARALLEL = 0.1  # sine of the angle between two axes, up to which they count as one


@dataclass(frozen=True)
class Axes:
    """No axis, one, two (orthogonal or not) or three orthogonal ones, fixed in neutral, the parent at rest.

    A rotation about the axis that turns first is followed by one about the second, as rotated by the first.

    Parameters
    ----------
    directions : array (dof, 3)
        Unit vectors, one for each angle.
    order : tuple of int
        Numbers of the angles in the order in which they turn.

    References
    ----------
    Wang 2019 §4, Eq. 5.
    """

    directions: Array
    order: tuple[int, ...]

    @property
    def dof(self) -> int:
        """Number of degrees of freedom, 0 to 3."""
        return len(self.directions)

    def rotation(self, angles: Array) -> Array:
        """Rotation (3, 3) at angles (dof,) in rad."""
        rotation = np.eye(3)
        for i in self.order:
            rotation = rotation @ Rotation.from_rotvec(angles[i] * self.directions[i]).as_matrix()
        return rotation

    def rates(self, angles: Array) -> Array:
        """Angular velocities (dof, 3) of the rotation for a unit rate of each of the angles (dof,)."""
        rates, rotation = np.empty((self.dof, 3)), np.eye(3)
        for i in self.order:
            rates[i] = rotation @ self.directions[i]
            rotation = rotation @ Rotation.from_rotvec(angles[i] * self.directions[i]).as_matrix()
        return rates

    def nearest(self, rotations: Array) -> Array:
        """Angles (n, dof) in rad whose rotations are nearest to rotations (n, 3, 3)."""
        if self.dof == 0:
            return np.zeros((len(rotations), 0))
        q = quaternions(rotations)
        if self.dof == 1:
            return 2 * np.arctan2(q[:, 1:] @ self.directions[0], q[:, 0])[:, None]
        if self.dof == 3:
            return self._nearest_of_three(rotations)
        a, b = (self.directions[i] for i in self.order)
        u, _, vt = np.linalg.svd(_half_angle_matrices(a, b, q))
        u, v = u[:, :, 0], vt[:, 0, :]
        # A quaternion and its negative are one rotation: both half angles go into (-90, 90] degrees.
        found = 2 * np.column_stack([np.arctan(u[:, 1] / u[:, 0]), np.arctan(v[:, 1] / v[:, 0])])
        return found[:, np.argsort(self.order)]

    def _nearest_of_three(self, rotations: Array) -> Array:
        """Three orthogonal axes reach every rotation: the angles (n, 3) are Euler angles in their frame."""
        directions = self.directions[list(self.order)]
        frame, side = directions.T.copy(), np.sign(np.linalg.det(directions))
        frame[:, 2] *= side
        found = Rotation.from_matrix(frame.T @ rotations @ frame).as_euler("XYZ")
        found[:, 2] *= side
        return found[:, np.argsort(self.order)]


def quaternions(rotations: Array) -> Array:
    """Unit quaternions (n, 4) as w, x, y, z with w >= 0 of rotations (n, 3, 3)."""
    xyzw = Rotation.from_matrix(rotations).as_quat(canonical=True)
    return xyzw[:, [3, 0, 1, 2]]


def fit_axes(rotations: Array, axis_hints: Array, weighing: Weighing | None = None) -> Axes:
    """Axes that explain rotations best.

    Which of two axes turns first is a convention in some joints and anatomy in others: the rotations decide.

    Parameters
    ----------
    rotations : array (n, 3, 3)
        Rotations of the child relative to the parent, from neutral.
    axis_hints : array (dof, 3)
        Rough axes. They fix the signs, and what the rotations leave undetermined.
    weighing : Weighing, optional
        Weights of the rotations and of the hints.

    Returns
    -------
    Axes
        Axes in the order in which they turn.

    References
    ----------
    Wang 2019 §4, Eqs. 1, 4 and 5.
    """
    q = quaternions(rotations)
    hints = np.array([h / np.linalg.norm(h) for h in np.asarray(axis_hints, float)])
    weighing = weighing or Weighing.plain(len(q))
    if len(hints) == 1:
        return Axes(_signed(_fit_one_axis(q, hints[0], weighing)[None], hints), (0,))
    return _better([(*_fit_two_axes(q, hints[list(order)], weighing), order) for order in ORDERS], hints)


def fit_oblique_axes(rotations: Array, axis_hints: Array, weighing: Weighing | None = None) -> Axes:
    """Two axes at any angle to one another, as in a saddle joint, that explain rotations (n, 3, 3) best.

    The orthogonal pair is the start; axis_hints (2, 3) and weighing as for `fit_axes`.
    """
    q = quaternions(rotations)
    hints = np.array([h / np.linalg.norm(h) for h in np.asarray(axis_hints, float)])
    weighing = weighing or Weighing.plain(len(q))
    start = fit_axes(rotations, hints, weighing)
    starts = [(start.directions[list(order)], hints[list(order)], order) for order in ORDERS]
    return _better([(*_refine_pair(q, at, near, weighing), order) for at, near, order in starts], hints)


def _better(fits: Sequence[tuple[Array, float, tuple[int, int]]], hints: Array) -> Axes:
    """Of fits (axes (2, 3) as they turn, residual, order) the axes with the smaller residual.

    Both orders may find one pair of axes under either name: then the axes nearer to the hints (2, 3).
    """
    least = min(lack for _, lack, _ in fits)
    alike = [(f[np.argsort(o)], o) for f, lack, o in fits if lack <= (1 + SAME) * least + SAME**2]
    found, order = max(alike, key=lambda fit: np.abs((fit[0] * hints).sum(axis=1)).sum())
    return Axes(_signed(found, hints), order)


def three_axes(axis_hints: Array) -> Axes:
    """Three orthogonal axes near hints (3, 3): a ball joint turns about any; these only name its angles."""
    return Axes(orthogonal_hints(axis_hints), (0, 1, 2))


def orthogonal_hints(axis_hints: Array) -> Array:
    """Unit axes (dof, 3) near hints (dof, 3), orthogonal to one another, the first one as it is."""
    hints = np.asarray(axis_hints, float)
    if len(hints) == 1:
        return hints / np.linalg.norm(hints[0])
    return _signed(_frame(hints[:2]).T[: len(hints)], hints)


def _signed(axes: Array, hints: Array) -> Array:
    return axes * np.where((axes * hints).sum(axis=1) < 0, -1.0, 1.0)[:, None]


def _fit_one_axis(q: Array, hint: Array, weighing: Weighing) -> Array:
    start = _principal(q, hint)[:, -1]
    start = start if start @ hint >= 0 else -start
    across = _complete(start)[:, 1:]

    def axis(tilt: Array) -> Array:
        return Rotation.from_rotvec(across @ tilt).apply(start)

    def residual(tilt: Array) -> Array:
        off = np.cross(q[:, 1:], axis(tilt))
        best = np.sqrt(np.maximum(1 - (off**2).sum(axis=1), 0))
        off = off * (weighing.weights * np.sqrt(2 / (1 + best)))[:, None]
        return np.concatenate([off.ravel(), _pull(axis(tilt)[None], hint[None], weighing)])

    return axis(_minimise(residual, 2)[0])


def _fit_two_axes(q: Array, hints: Array, weighing: Weighing) -> tuple[Array, float]:
    """Axes (2, 3) in the order in which they turn, and how far Eq. 4 stays below its bound."""
    principal = _principal(q, hints[0])
    starts = [hints, np.array([principal[:, 2], hints[1]]), np.array([hints[0], principal[:, 2]])]
    fits = [_refine_frame(q, _frame(start), hints, weighing) for start in starts if _spans(start)]
    frame, lack = min(fits, key=lambda fit: fit[1])
    return frame[:, :2].T, lack


def _refine_frame(q: Array, start: Array, hints: Array, weighing: Weighing) -> tuple[Array, float]:
    def frame(turn: Array) -> Array:
        return Rotation.from_rotvec(turn).as_matrix() @ start

    def residual(turn: Array) -> Array:
        turned = frame(turn)
        m = _half_angle_matrices(turned[:, 0], turned[:, 1], q)
        det = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
        # The singular values s, t of a matrix of unit norm: s^2 + t^2 = 1 and s t = |det|.
        s = (np.sqrt(np.maximum(1 + 2 * det, 0)) + np.sqrt(np.maximum(1 - 2 * det, 0))) / 2
        lack = weighing.weights * det / s * np.sqrt(2 / (1 + s))
        return np.concatenate([lack, _pull(turned[:, :2].T, hints, weighing)])

    turn, lack = _minimise(residual, 3)
    return frame(turn), lack


def _refine_pair(q: Array, start: Array, hints: Array, weighing: Weighing) -> tuple[Array, float]:
    """Axes (2, 3) in the order in which they turn, each tilted from its start, and their residual."""
    across = [_complete(axis)[:, 1:] for axis in start]

    def pair(tilts: Array) -> Array:
        return Rotation.from_rotvec([across[0] @ tilts[:2], across[1] @ tilts[2:]]).apply(start)

    def residual(tilts: Array) -> Array:
        """Quaternions minus those of the best angles: their squares sum to twice what Eq. 4 lacks."""
        a, b = pair(tilts)
        u, _, vt = np.linalg.svd(_half_angle_matrices(a, b, q))
        (c, s), (d, t) = u[:, :, 0].T, vt[:, 0, :].T
        best = np.column_stack(
            [
                c * d - s * t * (a @ b),
                np.outer(s * d, a) + np.outer(c * t, b) + np.outer(s * t, np.cross(a, b)),
            ]
        )
        lack = weighing.weights[:, None] * (q - best)
        return np.concatenate([lack.ravel(), _pull(np.array([a, b]), hints, weighing)])

    tilts, lack = _minimise(residual, 4)
    return pair(tilts), lack


def _pull(axes: Array, hints: Array, weighing: Weighing) -> Array:
    """Residuals of axes (k, 3) against their hints (k, 3), in half angles like the quaternions' residuals."""
    return (weighing.pull / 2 * np.cross(hints, axes)).ravel()


def _minimise(residual: Callable[[Array], Array], n: int) -> tuple[Array, float]:
    result = least_squares(residual, np.zeros(n), xtol=TOLERANCE, ftol=TOLERANCE, gtol=TOLERANCE)
    return result.x, float(result.cost)


def _principal(q: Array, hint: Array) -> Array:
    """Principal directions (3, 3) in columns of the quaternions' vectors, the leading one last."""
    return np.linalg.eigh(q[:, 1:].T @ q[:, 1:] + HINT_WEIGHT * np.outer(hint, hint))[1]


def _half_angle_matrices(a: Array, b: Array, q: Array) -> Array:
    """[[w, y], [x, z]] (n, 2, 2) of quaternions (w, v), x = v.a, y = v.b, z = v.(a x b) - w a.b.

    Their products with the cosines and sines of both half angles are the dot product with the rotation
    about a followed by that about b, whatever the angle between a and b.
    """
    w, x, y = q[:, 0], q[:, 1:] @ a, q[:, 1:] @ b
    z = q[:, 1:] @ np.cross(a, b) - w * (a @ b)
    return np.moveaxis(np.array([[w, y], [x, z]]), 2, 0)


def _spans(axes: Array) -> bool:
    return float(np.linalg.norm(np.cross(axes[0], axes[1]))) > PARALLEL


def _frame(axes: Sequence[Array] | Array) -> Array:
    """Right-handed frame (3, 3) of columns a, b made orthogonal to a, a x b."""
    a = axes[0] / np.linalg.norm(axes[0])
    b = axes[1] - (axes[1] @ a) * a
    b = b / np.linalg.norm(b)
    return np.column_stack([a, b, np.cross(a, b)])


def _complete(a: Array) -> Array:
    return _frame([a, np.eye(3)[np.argmin(np.abs(a))]])
