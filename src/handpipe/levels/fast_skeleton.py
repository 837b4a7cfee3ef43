"""Joint angles to the motions of all bones, compiled: the rig's own formula without its objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numba import njit

from handpipe.core import Array, IntArray
from handpipe.skeleton.rig import Rig

MOST_ANGLES, MOST_TERMS = 3, 9  # of a joint, and of its residual motion


@dataclass(frozen=True, eq=False)
class FastSkeleton:
    """Joints as arrays, in the order of the bones after the root.

    parents (j,): numbers of bones; first (j,), count (j,): angles of each joint; axes (j, 3, 3), order (j, 3);
    centres, offsets (j, 3) in mm; turns, shifts (j, 9, 3): coefficients of the residual motion in rad and mm;
    lower, upper (j, 3): range of its samples in rad.
    """

    parents: IntArray
    first: IntArray
    count: IntArray
    axes: Array
    order: IntArray
    centres: Array
    offsets: Array
    turns: Array
    shifts: Array
    lower: Array
    upper: Array

    @staticmethod
    def of(rig: Rig) -> FastSkeleton:
        """The joints of a rig."""
        bones, counts = rig.bones, [len(joint.angles) for joint in rig.joints]
        n = len(counts)
        made = FastSkeleton(
            np.array([bones.index(joint.parent) for joint in rig.joints], np.int64),
            np.cumsum([0, *counts])[:n].astype(np.int64),
            np.array(counts, np.int64),
            np.zeros((n, MOST_ANGLES, 3)),
            np.tile(np.arange(MOST_ANGLES), (n, 1)),
            np.array([joint.fit.centre for joint in rig.joints], float).reshape(n, 3),
            np.array([joint.fit.offset for joint in rig.joints], float).reshape(n, 3),
            np.zeros((n, MOST_TERMS, 3)),
            np.zeros((n, MOST_TERMS, 3)),
            np.zeros((n, MOST_ANGLES)),
            np.zeros((n, MOST_ANGLES)),
        )
        for i, joint in enumerate(rig.joints):
            fit, dof = joint.fit, counts[i]
            made.axes[i, :dof], made.order[i, :dof] = fit.axes.directions.reshape(-1, 3), fit.axes.order
            made.turns[i, : len(fit.rotation_residual.coefficients)] = fit.rotation_residual.coefficients
            made.shifts[i, : len(fit.translation_residual.coefficients)] = (
                fit.translation_residual.coefficients
            )
            made.lower[i, :dof], made.upper[i, :dof] = fit.rotation_residual.lower, fit.rotation_residual.upper
        return made

    def motions(self, angles: Array) -> Array:
        """Rotation and translation (b, 3, 4) of all bones from neutral at angles (a,) in rad; root at rest."""
        out = np.zeros((len(self.parents) + 1, 3, 4))
        self.move(angles, out)
        return out

    def move(self, angles: Array, out: Array) -> None:
        """As `motions`, into an array (b, 3, 4)."""
        _motions(
            angles, self.parents, self.first, self.count, self.axes, self.order, self.centres, self.offsets,
            self.turns, self.shifts, self.lower, self.upper, out,
        )  # fmt: skip

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return asdict(self)

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> FastSkeleton:
        """What `to_group` gave, as an artifact returned it."""
        return FastSkeleton(**{name: np.ascontiguousarray(value) for name, value in group.items()})


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
def _motions(
    angles, parents, first, count, axes, order, centres, offsets, turns, shifts, lower, upper, out
):  # type: ignore[no-untyped-def]
    out[0] = 0.0
    for i in range(3):
        out[0, i, i] = 1.0
    terms, single, small = np.zeros(9), np.zeros((3, 3)), np.zeros((3, 3))
    values, vector, apart = np.zeros(3), np.zeros(3), np.zeros(3)
    for j in range(len(parents)):
        dof = count[j]
        for i in range(dof):
            values[i] = angles[first[j] + i]
        turn = np.eye(3)
        apart[:] = offsets[j]
        for k in range(dof):
            i = order[j, k]
            for c in range(3):
                vector[c] = values[i] * axes[j, i, c]
            rotation(vector, single)
            if dof == 2 and k == 1:  # the second axis of a saddle passes the centre at a distance
                apart[:] = turn @ (offsets[j] - single @ offsets[j])
            turn = turn @ single
        if dof != 2:
            apart[:] = 0.0
        number = _terms(values, lower[j], upper[j], dof, terms)
        vector[:] = 0.0
        shift = np.zeros(3)
        for t in range(number):
            for c in range(3):
                vector[c] += terms[t] * turns[j, t, c]
                shift[c] += terms[t] * shifts[j, t, c]
        rotation(vector, small)
        whole = small @ turn
        # X -> small (turn (X - C) + apart) + C + shift
        place = small @ (apart - turn @ centres[j]) + centres[j] + shift
        above = out[parents[j]]
        here = out[j + 1]
        for r in range(3):
            for c in range(3):
                here[r, c] = (
                    above[r, 0] * whole[0, c] + above[r, 1] * whole[1, c] + above[r, 2] * whole[2, c]
                )
            here[r, 3] = (
                above[r, 0] * place[0] + above[r, 1] * place[1] + above[r, 2] * place[2] + above[r, 3]
            )
