"""Rigid motions that attachments leave free, and how marks settle them (Wang 2021 §5.6).

Wang 2021 stabilises an unattached object by its centroid and average rotation and alternates between strains
and placement. Here the motions are unknowns of the same Gauss-Newton step, and for given strains the
placement is the best one: the energy does not depend on it, so no new equilibrium is needed.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray, RigidTransform, left_jacobian
from handpipe.fem.linear import unit_twists
from handpipe.shapes.observations.correspondence import Correspondence

UNFELT = 1e-6  # of the largest resistance of attachments: three on a line do not resist rotation about it
ROUNDS, SETTLED = 20, 1e-7  # at most; motion, of the body's size, after which there are no more


class LooseMotions:
    """Twists (6, r), (velocity of the centre, angular velocity times size), that targets do not resist.

    If all targets are on one line, springs to them keep their lengths when the body rotates about it,
    wherever their other ends are: the targets alone decide.
    """

    def __init__(self, targets: Array, x: Array) -> None:
        """Loose motions of a body at positions x (n, 3), from the targets (t, 3) of its attached points."""
        self.centre = x.mean(axis=0)
        self.size = float(np.ptp(x, axis=0).max())
        self.twists = np.eye(6)
        if len(targets):
            felt = unit_twists(targets, self.centre, self.size)
            _, values, rows = np.linalg.svd(felt, full_matrices=len(felt) < 6)
            rank = int((values > UNFELT * values[0]).sum())
            self.twists = rows[rank:].T

    @property
    def count(self) -> int:
        """Number r of unconstrained rigid-body modes."""
        return self.twists.shape[1]

    def modes(self, x: Array) -> Array:
        """Displacements (3n, r) of positions x (n, 3)."""
        return unit_twists(x, self.centre, self.size) @ self.twists

    def pins(self, x: Array) -> IntArray:
        """Degrees of freedom (r,) whose fixing stops these motions without reactions at equilibrium."""
        if self.count == 0:
            return np.zeros(0, dtype=np.int64)
        pivots = scipy.linalg.qr(self.modes(x).T, mode="economic", pivoting=True)[2]
        return np.asarray(pivots[: self.count], dtype=np.int64)

    def transform(self, amounts: Array) -> RigidTransform:
        """The rigid transform of amounts (r,) of the motions, not linearised."""
        velocity, turn = np.split(self.twists @ amounts, 2)
        turn = turn / self.size
        rotation = Rotation.from_rotvec(turn).as_matrix()
        shift = left_jacobian(turn) @ velocity
        return RigidTransform(rotation, self.centre - rotation @ self.centre + shift)

    def settled(self, x: Array, points: Correspondence) -> Array:
        """Positions x (n, 3) moved rigidly so that the points are nearest to their targets.

        The correspondence measures the distances.
        """
        if self.count == 0 or points.count == 0:
            return x
        for _ in range(ROUNDS):
            matrix, residuals = points.rows(x)
            columns = matrix @ self.modes(x)
            amounts = -np.linalg.lstsq(columns, residuals, rcond=1e-9)[0]
            moved = self.transform(amounts)(x)
            if points.energy(moved) > points.energy(x):
                break
            x = moved
            if np.abs(amounts).max() < SETTLED * self.size:
                break
        return x
