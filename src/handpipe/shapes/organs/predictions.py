"""Place of each point as all other points predict it, without another fit.

Where smooth strains of a free body explain points to first order, the points' errors y are a Gaussian process
with the covariance of a Gauss-Newton step, and linear terms (Rasmussen and Williams 2006, 2.7). With P its
precision, the others' prediction of the rows i of one point has the error P_ii^-1 (P y)_i (the same, 5.4.2).
The body is free and not on the springs of attachments, which would pull these to any place.
"""

from __future__ import annotations

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.shapes.observations.attached import Attached
from handpipe.shapes.observations.marks import with_landmarks
from handpipe.shapes.optimisation.all_tets import AllTets
from handpipe.shapes.optimisation.gauss_newton import GaussNewton
from handpipe.shapes.optimisation.row_system import positive_solve
from handpipe.shapes.optimisation.strain_space import FindMarks, State


class Predictions:
    """Marks, then landmarks, then attachments as landmarks: rows of three a point, of weight one.

    marks, attachments: their numbers among `points`.
    """

    def __init__(self, system: GaussNewton, marks: int, known: int) -> None:
        lower = np.tril(system.gram(system.reactions()))
        self._gram = lower + np.tril(lower, -1).T
        self._free, self._ridge, self._wanted = system.free, system.ridge, system.wanted()
        self.points = np.arange(len(self._wanted) // 3)
        self.marks, self.attachments = self.points[:marks], self.points[marks + known :]

    @staticmethod
    def at(
        space: AllTets, state: State, marks: FindMarks, known: Attached | None, attached: Attached | None
    ) -> Predictions:
        """Of all points, about a state of an unconstrained body."""
        points = all_points(marks, known, attached)(state.x)
        counts = [0 if pairs is None else len(pairs.targets) for pairs in (known, attached)]
        system = space.system(state, (), points, 1.0)
        return Predictions(system, points.count - sum(counts), counts[0])

    def errors(self, asked: IntArray, among: IntArray, weight: float) -> Array:
        """Offsets (k, 3) in mm of points from the places that other points predict.

        `asked` (k,) are these points; the others of `among` predict them. Each point has the weight `weight`.
        Offsets are zero where the others are too few for a prediction.
        """
        if 3 * (len(among) - 1) <= self._free.shape[1]:
            return np.zeros((len(asked), 3))
        rows = (3 * among[:, None] + np.arange(3)).ravel()
        inverse = np.linalg.inv(self._gram[np.ix_(rows, rows)] + np.eye(len(rows)) / weight)
        free = self._free[rows]
        spread = inverse @ free
        schur = free.T @ spread + np.diag(self._ridge)
        precision = inverse - spread @ positive_solve(schur, spread.T)
        at = np.searchsorted(among, asked)
        blocks = precision.reshape(len(among), 3, len(among), 3)[at, :, at]
        pulls = (precision @ self._wanted[rows]).reshape(-1, 3)[at]
        return np.asarray(np.linalg.solve(blocks, pulls[..., None])[..., 0])


def all_points(marks: FindMarks, known: Attached | None, attached: Attached | None) -> FindMarks:
    """Marks, landmarks, and attachments as landmarks."""
    return with_landmarks(with_landmarks(marks, known), attached)
