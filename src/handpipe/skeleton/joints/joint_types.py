"""Which type of joint the data justify: the simplest that predicts left-out poses nearly as well as any.

One more angle always explains more of a left-out pose, noise included, since its angles are found in that
pose. A richer type is taken only where it lowers the left-out error by a good share and by more than noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handpipe.core import Array, RigidTransform
from handpipe.skeleton.joints.joints import DEGREES, JointFit, JointType, fit_joint, leave_one_out
from handpipe.skeleton.joints.prior import MotionNoise

ORDER: tuple[JointType, ...] = ("hinge", "universal", "saddle", "ball")
LEVER = 12.0  # mm at which a wrong rotation counts: half the width of what a bone carries about it
SHARE = 0.7  # of the simpler type's error that a richer one may have
NOISE = 0.12  # mm; registration of a bone: 0.1 mm, and 0.3 deg at the lever


def left_out_error(
    relative: Sequence[RigidTransform],
    joint_type: JointType,
    axis_hints: Array,
    *,
    near: Array,
    point: Array,
    lever: float = LEVER,
    noise: Sequence[MotionNoise] | None = None,
) -> float:
    """Error of a type of joint on poses left out of the fit one by one, each with its best angles.

    Parameters
    ----------
    relative : sequence of RigidTransform
        Motions of the child relative to the parent, from neutral.
    joint_type : str
        Type of the joint.
    axis_hints : array (3, 3)
        Rough axes; rows beyond the type's angles are ignored.
    near : array (3,)
        Rough centre in mm.
    point : array (3,)
        Point of the child whose place counts, in mm.
    lever : float
        Distance in mm at which rotations count.
    noise : sequence of MotionNoise, optional
        As for `fit_joint`.

    Returns
    -------
    float
        Root mean square over the poses in mm; infinite if the poses are too few for the type.
    """
    dof = DEGREES[joint_type]
    hints = np.asarray(axis_hints, float)[:dof]
    if len(relative) <= dof + 1:
        return float("inf")
    squares = []
    known = [None] * len(relative) if noise is None else [rest for rest, _ in leave_one_out(noise)]
    for (rest, left), rest_noise in zip(leave_one_out(relative), known, strict=True):
        fit = fit_joint(rest, dof, hints, near=near, joint_type=joint_type, noise=rest_noise)
        rotation, shift = fit.errors([left], point)
        squares.append(shift[0] ** 2 + (lever * rotation[0]) ** 2)
    return float(np.sqrt(np.mean(squares)))


def choose_type(
    relative: Sequence[RigidTransform],
    axis_hints: Array,
    *,
    near: Array,
    point: Array,
    types: Sequence[JointType] = ORDER,
    gain: float = NOISE,
    noise: Sequence[MotionNoise] | None = None,
) -> tuple[JointType, dict[JointType, float]]:
    """The type of joint that the data justify, and the left-out error of every type.

    Parameters
    ----------
    relative, axis_hints, near, point
        As for `left_out_error`.
    types : sequence of str
        Types to choose from, simpler ones first.
    gain : float
        Least decrease of the error in mm for which a richer type is taken.
    noise : sequence of MotionNoise, optional
        As for `fit_joint`.

    Returns
    -------
    joint_type : str
        The chosen type.
    errors : dict of str to float
        Left-out error in mm by type.
    """
    hints = complete_hints(axis_hints)
    errors: dict[JointType, float] = {
        t: left_out_error(relative, t, hints, near=near, point=point, noise=noise) for t in types
    }
    chosen = types[0]
    for richer in types[1:]:
        before, after = errors[chosen], errors[richer]
        if after < SHARE * before and before - after > gain:
            chosen = richer
    return chosen, errors


def fit_best(
    relative: Sequence[RigidTransform],
    dof: int,
    axis_hints: Array,
    *,
    near: Array,
    point: Array,
    noise: Sequence[MotionNoise] | None = None,
) -> JointFit:
    """The joint of the type that the data justify among those of `dof` degrees of freedom."""
    types = [t for t in ORDER if DEGREES[t] == dof]
    chosen, _ = choose_type(relative, axis_hints, near=near, point=point, types=types, noise=noise)
    return fit_joint(relative, dof, axis_hints, near=near, joint_type=chosen, noise=noise)


def complete_hints(axis_hints: Array) -> Array:
    """Three rows (3, 3): the given hints, and directions across them."""
    hints = np.asarray(axis_hints, float).reshape(-1, 3)
    if len(hints) == 1:
        hints = np.vstack([hints, np.cross(hints[0], np.eye(3)[np.argmin(np.abs(hints[0]))])])
    if len(hints) == 2:
        hints = np.vstack([hints, np.cross(*hints)])
    return hints
