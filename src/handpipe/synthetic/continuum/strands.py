"""Tendons as stiff strands: chains of points that tissue and bones carry."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from handpipe.core import Array, InputError, IntArray
from handpipe.fem.contact import Operator, PointPotential, penalty, per_point

BLUNT = 1e-3  # mm: a segment of no length has no direction
TOE = 0.02  # strain over which tension rises from none to its full slope, as collagen uncrimps


class Strands(PointPotential):
    """Energy sum over segments of S L p(e) at strain e = l / L - 1: tension where taut, none where slack.

    `operator` (k, n) takes nodes to the strands' points, segments (s, 2) name pairs of points, stiffness S in
    mN (Young's modulus times cross-section), one for all or one a segment. The penalty p is twice continuous:
    tension is S e^2 / (2 TOE) up to the strain TOE and S (e - TOE / 2) beyond. With `two_sided` it is a
    spring and pushes, too. Rest lengths are those at `rest` (n, 3). Segments are seen as the
    vectors between their ends, which are linear in x.
    """

    def __init__(
        self,
        operator: Operator,
        segments: IntArray,
        rest: Array,
        stiffness: ArrayLike,
        *,
        two_sided: bool = False,
    ) -> None:
        points = sp.csr_matrix(operator)
        super().__init__(points[segments[:, 1]] - points[segments[:, 0]])
        self.lengths = np.linalg.norm(self.points(rest), axis=1)
        if np.any(self.lengths == 0):
            problem = f"number {int(np.argmin(self.lengths))} has no length"
            raise InputError("strands", "segments", problem, "Give points apart from one another")
        self.stiffness = per_point(stiffness, self.count, "stiffness")
        self.two_sided = two_sided

    def _tensions(self, vectors: Array) -> tuple[Array, Array, Array, Array]:
        """Energies, tensions, their slopes and lengths, each (s,)."""
        now = np.linalg.norm(vectors, axis=1)
        strain = now / self.lengths - 1.0
        spring = 0.5 * strain**2, strain, np.ones_like(strain)
        energy, tension, slope = spring if self.two_sided else penalty(strain, TOE)
        s = self.stiffness
        return s * self.lengths * energy, s * tension, s / self.lengths * slope, now

    def strains(self, x: Array) -> Array:
        """Strain (s,) of every segment; negative where it is slack."""
        return np.linalg.norm(self.points(x), axis=1) / self.lengths - 1.0

    def tensions(self, x: Array) -> Array:
        """Tension (s,) in mN of every segment; negative where a two-sided one pushes."""
        return self._tensions(self.points(x))[1]

    def energies(self, points: Array) -> Array:
        """Energy (s,) in microjoules of segments given by their vectors (s, 3) in mm."""
        return self._tensions(points)[0]

    def forces(self, points: Array) -> Array:
        """Gradient (s, 3) in mN by the segments' vectors: tension along each segment."""
        _, tension, _, now = self._tensions(points)
        return (tension / np.maximum(now, 1e-300))[:, None] * points

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (s, 3, 3) in mN/mm; `project` drops the negative part in compression."""
        _, tension, slope, now = self._tensions(points)
        along = points / np.maximum(now, 1e-300)[:, None]
        dyads = along[:, :, None] * along[:, None, :]
        across = tension / np.maximum(now, 1e-300)
        if project:
            across = np.maximum(across, 0.0)
        return slope[:, None, None] * dyads + across[:, None, None] * (np.eye(3) - dyads)


class Cable(PointPotential):
    """Energy T sum l over segments of length l: a tendon that slides in its sheath under a tension T in mN.

    `operator` and `segments` as of `Strands`. The muscle at its far end lengthens or shortens as the tendon
    slides; where its line bends, it presses on its guides. Lengths are rounded at BLUNT mm.
    """

    def __init__(self, operator: Operator, segments: IntArray, tension: ArrayLike) -> None:
        points = sp.csr_matrix(operator)
        super().__init__(points[segments[:, 1]] - points[segments[:, 0]])
        self.tension = per_point(tension, self.count, "tension")

    def energies(self, points: Array) -> Array:
        """Energy (s,) in microjoules of segments given by their vectors (s, 3) in mm."""
        return self.tension * self._lengths(points)

    def forces(self, points: Array) -> Array:
        """Gradient (s, 3) in mN by the segments' vectors: the tension T along each segment."""
        return (self.tension / self._lengths(points))[:, None] * points

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (s, 3, 3) in mN/mm: semidefinite, with or without `project`."""
        length = self._lengths(points)
        along = points / length[:, None]
        across = np.eye(3) - along[:, :, None] * along[:, None, :]
        return (self.tension / length)[:, None, None] * across

    @staticmethod
    def _lengths(points: Array) -> Array:
        return np.sqrt((points**2).sum(axis=1) + BLUNT**2)


def chain(count: int, first: int = 0) -> IntArray:
    """Segments (count - 1, 2) between so many points in a row, numbered from `first`."""
    start = first + np.arange(count - 1)
    return np.column_stack([start, start + 1])
