"""Energies of a rod's positions: hooks, pull and bending (Zheng et al. 2022, Eq. 10-12).

Each has `value(x)`, `gradient(x) -> (n, 3)` and `add_hessian(x, blocks, exact)` for x (n, 3). Hessians are
block banded: blocks[i, k] (3, 3) is the second derivative by x_i and x_i+k, k = 0..REACH. `refresh(x)`
renews what one iteration of the solver holds fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numba import njit

from handpipe.core import Array, BoolArray, IntArray

REACH = 3  # vertices i and i + REACH may share a term, no further
RETURNS = 3  # times that a hook may hold a rod again in one solve
BISECTIONS = 80  # at most, to the least energy between two hooks


class RodEnergy(Protocol):
    """An energy of the vertices x (n, 3) in mm of a rod, in the unit of its forces times mm."""

    def refresh(self, x: Array) -> None:
        """Renew what one iteration of the solver takes as constant."""
        ...

    def value(self, x: Array) -> float:
        """Energy at x (n, 3)."""
        ...

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3): minus the force."""
        ...

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        """Add the second derivative to blocks (n, REACH + 1, 3, 3); it may be approximate unless `exact`."""
        ...


def empty_blocks(n: int) -> Array:
    """A zero Hessian (n, REACH + 1, 3, 3)."""
    return np.zeros((n, REACH + 1, 3, 3))


@dataclass
class EndForce:
    """-x_end . force: a constant force (3,) at the free end, Eq. 11 with c1 in the force."""

    force: Array

    def refresh(self, x: Array) -> None:
        """Nothing to renew: the force is constant."""

    def value(self, x: Array) -> float:
        """Energy at x (n, 3): -x_end . force."""
        return -float(x[-1] @ self.force)

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3): minus the force at the last vertex, zero at the others."""
        g = np.zeros_like(x)
        g[-1] = -self.force
        return g

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        """Adds nothing: the second derivative is zero."""


@dataclass
class Bend:
    """stiffness / length * sum(1 - d_i . d_i+1) over neighbouring segment directions d.

    The bending part of Eq. 12 in the positions: between hooks Eq. 4 alone is a chain of straight spans with a
    kink at each hook; this rounds the kinks over a length sqrt(stiffness / tension). Written as the quadratic
    form |x_i-1 - 2 x_i + x_i+1|^2 / 2, which is the same where the segments keep their length.
    """

    stiffness: float
    length: float

    def refresh(self, x: Array) -> None:
        """Nothing to renew: the energy has no internal state."""

    def _second(self, x: Array) -> Array:
        return x[:-2] - 2.0 * x[1:-1] + x[2:]

    @property
    def _scale(self) -> float:
        return self.stiffness / self.length**3

    def value(self, x: Array) -> float:
        """Energy at x (n, 3): zero for a straight rod of equal segments."""
        return 0.5 * self._scale * float(np.sum(self._second(x) ** 2))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3): minus the force."""
        second = self._scale * self._second(x)
        g = np.zeros_like(x)
        g[:-2] += second
        g[1:-1] -= 2.0 * second
        g[2:] += second
        return g

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        """Add the second derivative, constant and exact, to blocks (n, REACH + 1, 3, 3)."""
        n = len(x)
        identity = self._scale * np.eye(3)
        stencil = (1.0, -2.0, 1.0)
        for a in range(3):
            for b in range(a, 3):
                blocks[a : n - 2 + a, b - a] += stencil[a] * stencil[b] * identity


@dataclass
class Hooks:
    """weight * squared distance of each hook (k, 3) to the closest point of the rod, Eq. 10.

    The rod's curve is the quadratic B-spline of its vertices, tangent to every segment at its middle: on the
    polyline itself vertices catch at hooks, and a rod that must slide by many segments sticks. The closest
    point is minimised over at every evaluation. Hooks past an end of the curve are released: pulling the end
    towards them would stretch a taut rod. A hook that the curve reaches again is active again, but `RETURNS`
    times at most: else a rod could slide back and forth between the two states without end.
    """

    points: Array
    weights: Array
    engaged: BoolArray = field(init=False)
    returns: IntArray = field(init=False)

    def __init__(self, points: Array, weights: Array | float = 1.0) -> None:
        self.points = np.ascontiguousarray(points, float).reshape(-1, 3)
        self.weights = np.broadcast_to(np.asarray(weights, float), len(self.points)).copy()
        self.engaged = np.ones(len(self.points), bool)
        self.returns = np.zeros(len(self.points), np.int64)

    def refresh(self, x: Array) -> None:
        """Release hooks past an end of the curve; reattach them when reached, `RETURNS` times at most."""
        piece, t = closest_on_spline(self.points, x)
        before, after = (piece == 1) & (t == 0.0), (piece == len(x) - 2) & (t == 1.0)
        reached = ~(before | after)
        self.returns += reached & ~self.engaged & (self.returns <= RETURNS)
        self.engaged = reached & (self.returns <= RETURNS)

    def contacts(self, x: Array) -> Array:
        """Closest points (k, 3) of the rod's curve."""
        piece, t = closest_on_spline(self.points, x)
        return np.einsum("ka,kaj->kj", spline_shape(t), x[_triples(piece)])

    def _at(self, x: Array) -> tuple[IntArray, Array, Array, Array]:
        piece, t = closest_on_spline(self.points[self.engaged], x)
        vertices = _triples(piece)
        residual = np.einsum("ka,kaj->kj", spline_shape(t), x[vertices]) - self.points[self.engaged]
        return vertices, t, residual, self.weights[self.engaged]

    def value(self, x: Array) -> float:
        """Energy at x (n, 3), with each hook's closest point minimised over."""
        _, _, r, w = self._at(x)
        return float(w @ np.sum(r * r, axis=1))

    def gradient(self, x: Array) -> Array:
        """Gradient (n, 3): minus the force of the attached hooks."""
        vertices, t, r, w = self._at(x)
        g = np.zeros_like(x)
        np.add.at(g, vertices, 2.0 * (w[:, None] * spline_shape(t))[..., None] * r[:, None])
        return g

    def add_hessian(self, x: Array, blocks: Array, exact: bool) -> None:
        """Exact: the Schur complement by t of the Hessian in (x, t). Otherwise its Gauss-Newton part."""
        vertices, t, r, w = self._at(x)
        shape, slope = spline_shape(t), np.stack([t - 1.0, 1.0 - 2.0 * t, t], axis=1)
        corners = x[vertices]
        tangent = np.einsum("ka,kaj->kj", slope, corners)
        squared = np.sum(tangent**2, axis=1)
        cross = shape[..., None] * tangent[:, None]
        if exact:
            cross = cross + slope[..., None] * r[:, None]
            squared = squared + np.sum(r * (corners[:, 0] - 2.0 * corners[:, 1] + corners[:, 2]), axis=1)
        slides = (t > 0.0) & (t < 1.0) & (squared > 1e-12)
        share = np.where(slides, 1.0 / np.where(slides, squared, 1.0), 0.0)
        for a in range(3):
            for b in range(a, 3):
                block = (shape[:, a] * shape[:, b])[:, None, None] * np.eye(3)
                block = block - share[:, None, None] * cross[:, a, :, None] * cross[:, b, None, :]
                np.add.at(blocks[:, b - a], vertices[:, a], 2.0 * w[:, None, None] * block)


def _triples(piece: IntArray) -> IntArray:
    return piece[:, None] + np.array([-1, 0, 1])


def spline_shape(t: Array) -> Array:
    """Weights (k, 3) of vertices i - 1, i, i + 1 on piece i of a uniform quadratic B-spline at t (k,)."""
    return np.stack([0.5 * (1.0 - t) ** 2, 0.5 + t - t * t, 0.5 * t * t], axis=1)


@njit(cache=True)
def closest_on_spline(points: Array, x: Array) -> tuple[IntArray, Array]:
    """Piece (k,), 1 .. n - 2, and t in [0, 1] (k,) of the closest point of the B-spline of x (n, 3).

    The closest of all pieces, exactly: the squared distance is then continuous in x, also where two strands
    of a rod are equally near, which a line search needs.
    """
    pieces = np.empty(len(points), np.int64)
    parameters = np.empty(len(points))
    reach = np.zeros(len(x))  # a piece lies in the triangle of its vertex and the middles of its segments
    for i in range(1, len(x) - 1):
        reach[i] = 0.5 * np.sqrt(max(_squared(x, i, x, i - 1), _squared(x, i, x, i + 1)))
    for k in range(len(points)):
        best = np.inf
        for i in range(1, len(x) - 1):
            if np.sqrt(_squared(points, k, x, i)) - reach[i] >= np.sqrt(best):
                continue
            t, squared = _closest_on_piece(points, k, x, i)
            if squared < best:
                best, pieces[k], parameters[k] = squared, i, t
    return pieces, parameters


@njit(cache=True, inline="always")
def _squared(a: Array, i: int, b: Array, j: int) -> float:
    """Squared distance of a point of a (n, 3) and one of b (m, 3)."""
    return (a[i, 0] - b[j, 0]) ** 2 + (a[i, 1] - b[j, 1]) ** 2 + (a[i, 2] - b[j, 2]) ** 2


@njit(cache=True)
def _closest_on_piece(points: Array, k: int, x: Array, i: int) -> tuple[float, float]:
    """Parameter t in [0, 1] of the place of piece i nearest to point k, and its squared distance.

    The slope of the squared distance is a cubic in t. The zeros of its derivative part [0, 1] into at most
    three intervals; each has at most one zero of the slope. Sums are written out: arrays of three numbers
    would take most of the time.
    """
    start_tangent = tangent_tangent = start_bend = tangent_bend = bend_bend = start_start = 0.0
    for j in range(3):
        a, b, c = x[i - 1, j] - points[k, j], x[i, j] - points[k, j], x[i + 1, j] - points[k, j]
        start, tangent, bend = 0.5 * (a + b), b - a, a - 2.0 * b + c
        start_start += start * start
        start_tangent += start * tangent
        start_bend += start * bend
        tangent_tangent += tangent * tangent
        tangent_bend += tangent * bend
        bend_bend += bend * bend
    c0, c1, c2, c3 = start_tangent, tangent_tangent + start_bend, 1.5 * tangent_bend, 0.5 * bend_bend
    first = second = 1.0
    discriminant = 4.0 * c2 * c2 - 12.0 * c3 * c1
    if discriminant > 0.0 and c3 > 0.0:
        root = np.sqrt(discriminant)
        lower, upper = (-2.0 * c2 - root) / (6.0 * c3), (-2.0 * c2 + root) / (6.0 * c3)
        first = lower if 0.0 < lower < 1.0 else 1.0
        second = upper if 0.0 < upper < 1.0 else 1.0
        first, second = (second, 1.0) if first == 1.0 else (first, second)
    best_t, best = 0.0, start_start
    low = 0.0
    for high in (first, second, 1.0):
        if high <= low:
            continue
        t = _zero_of_cubic(c0, c1, c2, c3, low, high)
        low = high
        squared = 0.0
        for j in range(3):
            a, b, c = x[i - 1, j] - points[k, j], x[i, j] - points[k, j], x[i + 1, j] - points[k, j]
            squared += (0.5 * (a + b) + t * (b - a) + 0.5 * t * t * (a - 2.0 * b + c)) ** 2
        if squared < best:
            best_t, best = t, squared
    return best_t, best


@njit(cache=True)
def _zero_of_cubic(c0: float, c1: float, c2: float, c3: float, low: float, high: float) -> float:
    """Where a cubic rises through zero in an interval; the interval's end where it does not."""
    t = high
    if c0 + low * (c1 + low * (c2 + low * c3)) < 0.0 < c0 + high * (c1 + high * (c2 + high * c3)):
        t = 0.5 * (low + high)
        for _ in range(BISECTIONS):
            slope = c0 + t * (c1 + t * (c2 + t * c3))
            low, high = (t, high) if slope < 0.0 else (low, t)
            curvature = c1 + t * (2.0 * c2 + 3.0 * t * c3)
            step = t - slope / curvature if curvature > 0.0 else low
            following = step if low < step < high else 0.5 * (low + high)
            if abs(following - t) < 1e-15:
                break
            t = following
    return t
