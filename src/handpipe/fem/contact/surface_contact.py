"""One-sided contact of points with a closed surface, which no planes stand for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import ArrayLike

from handpipe.core import Array, IntArray
from handpipe.fem.contact.closest_feature import shape_operators
from handpipe.fem.contact.constraints import Operator
from handpipe.fem.contact.one_sided import penalty
from handpipe.fem.contact.points import PointPotential, dyads, per_point
from handpipe.mesh.surfaces import Distance

ON_SURFACE = 1e-9  # mm; nearer than this the direction to the closest point is rounding


class SurfaceContact(PointPotential):
    """Contact constraint that keeps points outside of a closed surface, by a penalty.

    Every evaluation computes the signed distance, so energy and gradient agree however far a point has slid.
    The Hessian is exact for the polyhedron: the distance has curvature where an edge or a vertex is closest
    (outside of convex, inside of concave places) and is linear over faces. The distance is not computed for a
    point that must be more than `far` mm beyond the thickness: the surface's box, or how little the point has
    moved since its distance was computed, proves that.

    Parameters
    ----------
    operator : sparse matrix (k, n)
        Takes vertex positions (n, 3) to points (k, 3).
    distance : Distance
        Signed distances to the closed surface in mm, negative inside.
    stiffness : float or array (k,)
        Stiffness in mN/mm at depths of `onset` or more, zero or more.
    thickness : float
        Signed distance in mm below which points are pushed outwards.
    onset : float
        Depth in mm over which the stiffness rises from zero (see `penalty`); zero or less: a sudden rise.
    reach : float
        Length in mm by which a point may move, beyond its free distance, within one Newton step: with longer
        steps it could pass through a thin body undetected.

    Raises
    ------
    InputError
        If a stiffness is misshapen, negative or not finite.
    """

    one_sided = True
    far = 0.25  # mm beyond the thickness
    each = ("stiffness",)

    def __init__(
        self,
        operator: Operator,
        distance: Distance,
        stiffness: ArrayLike,
        thickness: float = 0.0,
        onset: float = 0.05,
        reach: float = 1.0,
    ) -> None:
        super().__init__(operator)
        self.distance = distance
        self.stiffness = per_point(stiffness, self.count, "stiffness")
        self.thickness, self.onset, self.reach = thickness, onset, reach
        self._parts: list[tuple[int, Distance]] = [(0, distance)]
        self._last: tuple[Array, Array, Array, Array] | None = None

    def moved(self, distance: Distance) -> Self:
        """The same constraint against a surface at another place or of another shape."""
        other = self.twin()
        other.distance, other._last, other._parts = distance, None, [(0, distance)]
        return other

    @classmethod
    def stacked(cls, constraints: Sequence[Self]) -> list[Self]:
        """The points of several constraints in one, each against its own surface; nothing for none.

        Parameters
        ----------
        constraints : sequence of SurfaceContact
            Constraints of the same vertices with the same thickness, onset and reach.

        Returns
        -------
        list of SurfaceContact
            One constraint with their energy. With many small constraints, calls would take most of the time.
        """
        if len(constraints) < 2:
            return list(constraints)
        first = constraints[0]
        operator = sp.vstack([c.operator for c in constraints], format="csr")
        stiffness = np.concatenate([c.stiffness for c in constraints])
        one = cls(operator, first.distance, stiffness, first.thickness, first.onset, first.reach)
        starts = np.cumsum([0, *(c.count for c in constraints)])
        one._parts = [
            (int(a) + at, d) for a, c in zip(starts[:-1], constraints, strict=True) for at, d in c._parts
        ]
        return [one]

    def _chosen(self, ids: IntArray, operator: sp.csr_matrix) -> Self:
        other = super()._chosen(ids, operator)
        starts = np.searchsorted(ids, [start for start, _ in self._parts])
        other._parts = [(int(at), distance) for at, (_, distance) in zip(starts, self._parts, strict=True)]
        other._last = None
        return other

    def _query(self, points: Array) -> tuple[Array, Array, Array]:
        """Signed distances (k,), their gradients (k, 3) and `shape_operators` (k, 3, 3)."""
        if self._last is None or not np.array_equal(self._last[0], points):
            signed, normals, shapes = self._far(points)
            if self._last is not None:
                moved = np.linalg.norm(points - self._last[0], axis=1)
                signed = np.maximum(signed, self._last[1] - moved)
            near = np.flatnonzero(signed < self.thickness + self.far)
            signed[near], normals[near], shapes[near] = self._near(near, points[near])
            self._last = points.copy(), signed, normals, shapes
        return self._last[1:]

    def _far(self, points: Array) -> tuple[Array, Array, Array]:
        """Lower bounds of the distances of points (k, 3) by the surface's box, with zero derivatives."""
        beyond = np.zeros(len(points))
        starts = [start for start, _ in self._parts]
        for start, end, (_, distance) in zip(starts, [*starts[1:], len(points)], self._parts, strict=True):
            _fill_beyond(points, *distance.surface.box, beyond, start, end)
        return beyond, np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))

    def _near(self, ids: IntArray, points: Array) -> tuple[Array, Array, Array]:
        """Signed distances, their gradients and shape operators of the points of some ids, sorted."""
        if len(self._parts) == 1:
            return _measured(self.distance, points)
        ends = np.searchsorted(ids, [start for start, _ in self._parts[1:]])
        pieces = zip(self._parts, np.split(points, ends), strict=True)
        found = [_measured(distance, mine) for (_, distance), mine in pieces if len(mine)]
        if not found:
            return np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3))
        signed, normals, shapes = (np.concatenate(values) for values in zip(*found, strict=True))
        return signed, normals, shapes

    def depths(self, points: Array) -> Array:
        """How far (k,) each point is beneath the thickness; negative where it is free."""
        return self.thickness - self._query(points)[0]

    def max_step(self, x: Array, step: Array) -> float:
        """Fraction of a step within which no point can go deeper than `reach`: distance is 1-Lipschitz."""
        allowed = self.reach + np.maximum(-self.depths(self.points(x)), 0.0)
        lengths = np.where(self.stiffness > 0, np.linalg.norm(self.operator @ step, axis=1), 0.0)
        return float(min(1.0, (allowed / np.maximum(lengths, 1e-300)).min(initial=1.0)))

    def energies(self, points: Array) -> Array:
        """Energy (k,) in microjoules of each point; zero at `thickness` or more outside the surface."""
        return self.stiffness * penalty(self.depths(points), self.onset)[0]

    def forces(self, points: Array) -> Array:
        """Gradient (k, 3) in mN of each point's energy, along the gradient of the distance."""
        first = self.stiffness * penalty(self.depths(points), self.onset)[1]
        return -first[:, None] * self._query(points)[1]

    def stiffnesses(self, points: Array, project: bool) -> Array:
        """Second derivative (k, 3, 3) in mN/mm; `project` drops the curvature of the distance outside."""
        depths, found = self.depths(points), np.zeros((len(points), 3, 3))
        active = np.flatnonzero(depths > 0.0)
        _, first, second = penalty(depths[active], self.onset)
        signed, normals, shapes = (values[active] for values in self._query(points))
        stiffness = self.stiffness[active]
        curved = -(stiffness * first)[:, None, None] * _distance_hessians(signed, shapes)
        if project:  # a point outside is pushed on from an edge, along which its energy is concave
            curved[signed > 0] = 0.0
        found[active] = (stiffness * second)[:, None, None] * dyads(normals) + curved
        return found


def _distance_hessians(signed: Array, shapes: Array) -> Array:
    """Second derivatives (k, 3, 3) of signed distances (k,) with shape operators (k, 3, 3)."""
    return shapes / np.where(np.abs(signed) > ON_SURFACE, signed, 1.0)[:, None, None]


def _measured(distance: Distance, points: Array) -> tuple[Array, Array, Array]:
    """Signed distances (k,) of points (k, 3), their gradients (k, 3) and `shape_operators` (k, 3, 3)."""
    signed, triangles, closest, normals = distance.signed(points)
    away = np.abs(signed) > ON_SURFACE
    normals[away] = (points[away] - closest[away]) / signed[away, None]
    surface = distance.surface
    shapes = shape_operators(normals, closest, triangles, surface.vertices, surface.triangles)
    shapes[~away] = 0.0
    return signed, normals, shapes


@njit(cache=True)
def _fill_beyond(points: Array, low: Array, high: Array, out: Array, start: int, end: int) -> None:
    """Fill out[start:end] with the distances of points (k, 3) from a box."""
    for i in range(start, end):
        total = 0.0
        for k in range(3):
            total += max(low[k] - points[i, k], points[i, k] - high[k], 0.0) ** 2
        out[i] = np.sqrt(total)
