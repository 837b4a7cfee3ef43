"""Joint angles to the motions of all bones, compiled: the rig's own formula without its objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from handpipe.core import Array, IntArray
from handpipe.skeleton.rig import Rig

MOST_ANGLES, MOST_TERMS = 3, 9  # of a joint, and of its residual motion


class JointArrays(NamedTuple):
    """Joints in the order of the bones after the root.

    parents (j,): numbers of bones; first (j,), dofs (j,): first angle and number of angles; axes (j, 3, 3),
    order (j, 3); centres, offsets (j, 3) in mm; turns, shifts (j, 9, 3): coefficients of the residual motion
    in rad and mm; lower, upper (j, 3): range of its samples in rad.
    """

    parents: IntArray
    first: IntArray
    dofs: IntArray
    axes: Array
    order: IntArray
    centres: Array
    offsets: Array
    turns: Array
    shifts: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, eq=False)
class FastSkeleton:
    """Joint angles to motions of bones in microseconds."""

    joints: JointArrays

    @staticmethod
    def of(rig: Rig) -> FastSkeleton:
        """The joints of a rig."""
        bones, counts = rig.bones, [len(joint.angles) for joint in rig.joints]
        n = len(counts)
        made = JointArrays(
            np.array([bones.index(joint.parent) for joint in rig.joints], np.int64),
            np.cumsum([0, *counts])[:n].astype(np.int64),
            np.array(counts, np.int64),
            np.zeros((n, MOST_ANGLES, 3)),
            np.tile(np.arange(MOST_ANGLES), (n, 1)),
            np.array([joint.fit.centre for joint in rig.joints], float).reshape(n, 3),
            np.array([joint.fit.offset for joint in rig.joints], float).reshape(n, 3),
            *(np.zeros((n, MOST_TERMS, 3)) for _ in range(2)),
            *(np.zeros((n, MOST_ANGLES)) for _ in range(2)),
        )
        for i, joint in enumerate(rig.joints):
            axes, turn, shift = joint.fit.axes, joint.fit.rotation_residual, joint.fit.translation_residual
            dof = counts[i]
            made.axes[i, :dof], made.order[i, :dof] = axes.directions.reshape(-1, 3), axes.order
            made.turns[i, : len(turn.coefficients)] = turn.coefficients
            made.shifts[i, : len(shift.coefficients)] = shift.coefficients
            made.lower[i, :dof], made.upper[i, :dof] = turn.lower, turn.upper
        return FastSkeleton(made)

    def motions(self, angles: Array) -> Array:
        """Rotation and translation (b, 3, 4) of all bones from neutral at angles (a,) in rad."""
        out = np.zeros((len(self.joints.parents) + 1, 3, 4))
        _motions(np.ascontiguousarray(angles, np.float64), self.joints, out)
        return out

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return self.joints._asdict()

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> FastSkeleton:
        """What `to_group` gave, as an artifact returned it."""
        return FastSkeleton(JointArrays(**group))


@njit(cache=True)
def rotation(vector: Array, out: Array) -> None:
    """Rotation (3, 3) of a rotation vector (3,) in rad (Rodrigues)."""
    x, y, z = vector[0], vector[1], vector[2]
    angle = np.sqrt(x * x + y * y + z * z)
    if angle < 1e-8:
        a, b = 1.0, 0.5
    else:
        a, b = np.sin(angle) / angle, (1.0 - np.cos(angle)) / (angle * angle)
    out[0, 0], out[0, 1], out[0, 2] = 1 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y
    out[1, 0], out[1, 1], out[1, 2] = b * x * y + a * z, 1 - b * (x * x + z * z), b * y * z - a * x
    out[2, 0], out[2, 1], out[2, 2] = b * x * z - a * y, b * y * z + a * x, 1 - b * (x * x + y * y)


@njit(cache=True)
def _terms(values: Array, lower: Array, upper: Array, count: int, out: Array) -> int:
    """Terms of a joint's residual motion (`handpipe.skeleton.joints.residual.features`); their number."""
    for i in range(count):
        clamped = min(max(values[i], lower[i]), upper[i])
        out[i] = values[i]
        out[count + i] = clamped * (2 * values[i] - clamped)
    if count == 2:
        out[4] = out[3]
        out[3] = values[0] * values[1]
        return 5
    if count == 3:
        out[6], out[7], out[8] = values[0] * values[1], values[0] * values[2], values[1] * values[2]
        return 9
    return 2 * count


@njit(cache=True)
def _turned(joints: JointArrays, j: int, values: Array, turn: Array, apart: Array) -> None:
    """A joint's rotation (3, 3) about its axes, and what the offset of the second one adds (3,) in mm."""
    single, vector = np.zeros((3, 3)), np.zeros(3)
    turn[:] = np.eye(3)
    apart[:] = 0.0
    for k in range(joints.dofs[j]):
        i = joints.order[j, k]
        for c in range(3):
            vector[c] = values[i] * joints.axes[j, i, c]
        rotation(vector, single)
        if joints.dofs[j] == 2 and k == 1:
            apart[:] = turn @ (joints.offsets[j] - single @ joints.offsets[j])
        turn[:] = turn @ single


@njit(cache=True)
def _residual(joints: JointArrays, j: int, values: Array, turn: Array, shift: Array) -> None:
    """A joint's residual rotation (3, 3) and translation (3,) in mm."""
    terms, vector = np.zeros(9), np.zeros(3)
    number = _terms(values, joints.lower[j], joints.upper[j], joints.dofs[j], terms)
    shift[:] = 0.0
    for t in range(number):
        for c in range(3):
            vector[c] += terms[t] * joints.turns[j, t, c]
            shift[c] += terms[t] * joints.shifts[j, t, c]
    rotation(vector, turn)


@njit(cache=True)
def _motions(angles: Array, joints: JointArrays, out: Array) -> None:
    """Motions (b, 3, 4) of all bones at angles (a,)."""
    out[0] = 0.0
    for i in range(3):
        out[0, i, i] = 1.0
    turn, small, values = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    apart, shift = np.zeros(3), np.zeros(3)
    for j in range(len(joints.parents)):
        for i in range(joints.dofs[j]):
            values[i] = angles[joints.first[j] + i]
        _turned(joints, j, values, turn, apart)
        _residual(joints, j, values, small, shift)
        # X -> small (turn (X - C) + apart) + C + shift, then the parent's motion
        centre, above = joints.centres[j], out[joints.parents[j]]
        whole = small @ turn
        place = small @ (apart - turn @ centre) + centre + shift
        for r in range(3):
            out[j + 1, r, 3] = above[r, 3]
            for c in range(3):
                out[j + 1, r, 3] += above[r, c] * place[c]
                out[j + 1, r, c] = (
                    above[r, 0] * whole[0, c] + above[r, 1] * whole[1, c] + above[r, 2] * whole[2, c]
                )
