"""Rotation axes of a joint from relative rotations of its child bone (Wang 2019, Eq. 1, 4 and 5).

For fixed axes the best angles are closed form. One axis: the dot product of a unit quaternion (w, v) with a
rotation about `a` is at most sqrt(w^2 + (v.a)^2). Two orthogonal axes, columns of a frame in which the
quaternion reads (w, x, y, z): it is at most the larger singular value of [[w, y], [x, z]], whose singular
vectors are the cosines and sines of the half angles. What the best dot product s lacks to one is written as a
square, 2 (1 - s) = |residual|^2, so that a least-squares solver maximises Eq. 1 or Eq. 4.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
TOLERANCE = 1e-14


def quaternions(rotations: Array) -> Array:
    """Unit quaternions (n, 4) as w, x, y, z with w >= 0 of rotations (n, 3, 3)."""
    xyzw = Rotation.from_matrix(rotations).as_quat(canonical=True)
    return xyzw[:, [3, 0, 1, 2]]


def rotation_about(axes: Array, angles: Array) -> Array:
    """Rotation (3, 3): about axes[0] by angles[0], then about the rotated axes[1] by angles[1], if there is one."""
    rotation = np.eye(3)
    for axis, angle in zip(axes, angles, strict=True):
        rotation = rotation @ Rotation.from_rotvec(angle * axis).as_matrix()
    return rotation


def best_angles(axes: Array, rotations: Array) -> Array:
    """Angles (n, dof) in rad about fixed axes (dof, 3) nearest to rotations (n, 3, 3)."""
    q = quaternions(rotations)
    if len(axes) == 1:
        return 2 * np.arctan2(q[:, 1:] @ axes[0], q[:, 0])[:, None]
    u, _, vt = np.linalg.svd(_half_angle_matrices(_frame(axes), q))
    u, v = u[:, :, 0], vt[:, 0, :]
    # A quaternion and its negative are one rotation: both half angles go into (-90, 90] degrees.
    return 2 * np.column_stack([np.arctan(u[:, 1] / u[:, 0]), np.arctan(v[:, 1] / v[:, 0])])


def fit_axes(rotations: Array, axis_hints: Array) -> Array:
    """Unit axes (dof, 3), orthogonal if two, that explain rotations (n, 3, 3) best (Eq. 1; Eq. 4 and 5).

    axis_hints (dof, 3): rough axes; they fix the signs, and what the rotations leave undetermined.
    """
    q = quaternions(rotations)
    fit = _fit_one_axis if len(axis_hints) == 1 else _fit_two_axes
    return fit(q, np.array([h / np.linalg.norm(h) for h in np.asarray(axis_hints, float)]))


def _fit_one_axis(q: Array, hints: Array) -> Array:
    moments = q[:, 1:].T @ q[:, 1:]
    # A hundredth of a degree of prior in the hint's favour decides only where nothing moved.
    start = np.linalg.eigh(moments + 1e-8 * np.outer(hints[0], hints[0]))[1][:, -1]
    frame = _complete(start)

    def axis(tilt: Array) -> Array:
        return Rotation.from_rotvec(frame[:, 1:] @ tilt).apply(start)

    def residual(tilt: Array) -> Array:
        off = np.cross(q[:, 1:], axis(tilt))
        best = np.sqrt(np.maximum(1 - (off**2).sum(axis=1), 0))
        return (off * np.sqrt(2 / (1 + best))[:, None]).ravel()

    tilt = _minimise(residual, 2)[0]
    found = axis(tilt)
    return (found * (1.0 if found @ hints[0] > 0 else -1.0))[None]


def _fit_two_axes(q: Array, hints: Array) -> Array:
    principal = np.linalg.eigh(q[:, 1:].T @ q[:, 1:] + 1e-8 * np.outer(hints[0], hints[0]))[1]
    starts = [hints, np.array([principal[:, 2], hints[1]]), np.array([hints[0], principal[:, 1]])]
    candidates = [_refine_frame(q, _frame(start)) for start in starts if _spans(start)]
    frame = min(candidates, key=lambda c: c[1])[0]
    axes = frame[:, :2].T
    return axes * np.where((axes * hints).sum(axis=1) > 0, 1.0, -1.0)[:, None]


def _refine_frame(q: Array, start: Array) -> tuple[Array, float]:
    def frame(turn: Array) -> Array:
        return Rotation.from_rotvec(turn).as_matrix() @ start

    def residual(turn: Array) -> Array:
        m = _half_angle_matrices(frame(turn), q)
        det = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
        # The singular values s, t of a matrix of unit norm: s^2 + t^2 = 1 and s t = |det|.
        s = (np.sqrt(np.maximum(1 + 2 * det, 0)) + np.sqrt(np.maximum(1 - 2 * det, 0))) / 2
        return det / s * np.sqrt(2 / (1 + s))

    turn, cost = _minimise(residual, 3)
    return frame(turn), cost


def _minimise(residual: object, n: int) -> tuple[Array, float]:
    result = least_squares(
        residual, np.zeros(n), jac="3-point", xtol=TOLERANCE, ftol=TOLERANCE, gtol=TOLERANCE
    )
    return result.x, float(result.cost)


def _half_angle_matrices(frame: Array, q: Array) -> Array:
    """[[w, y], [x, z]] (n, 2, 2) of quaternions seen in the frame whose columns are a, b, a x b."""
    x, y, z = (q[:, 1:] @ frame).T
    return np.moveaxis(np.array([[q[:, 0], y], [x, z]]), 2, 0)


def _spans(axes: Array) -> bool:
    return float(np.linalg.norm(np.cross(axes[0], axes[1]))) > 0.1


def _frame(axes: Sequence[Array] | Array) -> Array:
    """Right-handed frame (3, 3) of columns a, b made orthogonal to a, a x b."""
    a = axes[0] / np.linalg.norm(axes[0])
    b = axes[1] - (axes[1] @ a) * a
    b = b / np.linalg.norm(b)
    return np.column_stack([a, b, np.cross(a, b)])


def _complete(a: Array) -> Array:
    return _frame([a, np.eye(3)[np.argmin(np.abs(a))]])
