"""Correctives before skinning: each bone's part of a layer has shapes that the joints near it drive."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handpipe.core import Array, IntArray
from handpipe.levels import kernels
from handpipe.levels.regression import Regression, fit_regression, kernel_of

log = logging.getLogger(__name__)
LEAST_WEIGHT = 0.05  # of a bone at a vertex that its part has
SINGULAR = 0.1  # determinant of a blend of motions below which its inverse is damped
DAMPING = 0.0025  # added to the squared singular values of such a blend


@dataclass(frozen=True, eq=False)
class Correctives:
    """Shapes of all parts, and what drives them.

    lower, upper (a,): range of the learned angles in rad; errors (p,): root mean square distance in mm of
    left-out frames.
    """

    lower: Array
    upper: Array
    drivers: kernels.Drivers
    shapes: kernels.VertexShapes
    errors: Array

    def amounts(self, angles: Array) -> Array:
        """Coefficients (K,) of the shapes at angles (a,) in rad, in single precision."""
        out = np.zeros(self.drivers.ends[-1])
        kernels.coefficients(scaled(angles, self.lower, self.upper), self.drivers, out)
        return single(out)

    def learned_amounts(self, part: int) -> Array:
        """Coefficients (F, K) of a part's shapes in the F learned poses."""
        drivers = self.drivers
        angles, shapes = (int(at[part + 1] - at[part]) for at in (drivers.at, drivers.ends))
        known = drivers.known[drivers.known_at[part] : drivers.known_at[part + 1]].reshape(-1, angles)
        gains = drivers.gains[drivers.gains_at[part] : drivers.gains_at[part + 1]].reshape(-1, shapes)
        degree, width = drivers.kinds[part]
        return np.asarray(kernel_of((int(degree), width), known, known) @ gains)

    def add(self, rest: Array, angles: Array, out: Array) -> None:
        """Neutral points (n, 3) with the shapes at angles (a,) in rad added, into out (n, 3), mm."""
        kernels.correct(rest, self.shapes, self.drivers.ends, self.amounts(angles), out)

    def of_vertices(self, which: IntArray) -> Correctives:
        """The same for some of the vertices, by their numbers."""
        before, parts, starts, basis = self.shapes
        counts = np.diff(before)[which]
        rows = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        kept = np.repeat(before[which] - rows[:-1], counts) + np.arange(rows[-1])
        return replace(self, shapes=kernels.VertexShapes(rows, parts[kept], starts[kept], basis))

    def with_plain(self, count: int) -> Correctives:
        """The same with further vertices that nothing is added to."""
        rows = self.shapes.rows
        return replace(
            self, shapes=self.shapes._replace(rows=np.append(rows, np.full(count, rows[-1], np.int32)))
        )

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        parts = {"drivers": self.drivers._asdict(), "shapes": self.shapes._asdict()}
        return {"lower": self.lower, "upper": self.upper, "errors": self.errors, **parts}

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> Correctives:
        """What `to_group` gave, as an artifact returned it."""
        return Correctives(
            group["lower"],
            group["upper"],
            kernels.Drivers(**group["drivers"]),
            kernels.VertexShapes(**group["shapes"]),
            group["errors"],
        )


def single(values: Array) -> Array:
    """Values in single precision, as the loops over vertices take them."""
    return np.ascontiguousarray(values, np.float32)


def scaled(angles: Array, lower: Array, upper: Array) -> Array:
    """Angles with the learned range at -1 to 1; zero where it has no width."""
    width = upper - lower
    moving = width > 0
    return np.where(moving, (2 * angles - lower - upper) / np.where(moving, width, 1.0), 0.0)


def before_skinning(rest: Array, moved: Array, joints: IntArray, weights: Array, motions: Array) -> Array:
    """What added to neutral points (n, 3) gives the moved ones after skinning, mm.

    Where a blend of motions is nearly singular its inverse is damped: a finite corrective that leaves little.
    """
    blends = np.einsum("nk,nkij->nij", weights, motions[joints])
    turns, error = blends[:, :, :3], moved - np.einsum("nij,nj->ni", blends[:, :, :3], rest) - blends[:, :, 3]
    damping = np.where(np.linalg.det(turns) < SINGULAR, DAMPING, 0.0)
    normal = turns.transpose(0, 2, 1) @ turns + damping[:, None, None] * np.eye(3)
    return np.linalg.solve(normal, turns.transpose(0, 2, 1) @ error[:, :, None])[:, :, 0]


@dataclass(frozen=True, eq=False)
class Skinned:
    """Points of all bodies: rest (n, 3), joints and weights (n, 4), corrections (F, n, 3) in frames, mm.

    groups (n,): numbers of the layers, which share no parts.
    """

    rest: Array
    groups: IntArray
    joints: IntArray
    weights: Array
    corrections: Array


@dataclass(frozen=True, eq=False)
class _Part:
    """A bone's part of a layer: numbers of vertices (m,), their shapes (K, m, 3) in mm, the regression."""

    vertices: IntArray
    shapes: Array
    fitted: Regression


def learn_correctives(
    skinned: Skinned, angles: Array, neighbourhoods: Mapping[int, list[tuple[int, ...]]]
) -> Correctives:
    """Correctives of frames at angles (F, a) in rad.

    neighbourhoods: numbers of angles that may drive a bone's part, by its number; the fewest first.
    """
    lower, upper = angles.min(axis=0), angles.max(axis=0)
    places, shares = scaled(angles, lower, upper), _shares(skinned, max(neighbourhoods, default=0) + 1)
    parts = []
    for group in np.unique(skinned.groups):
        for bone, near in neighbourhoods.items():
            own = np.flatnonzero((shares[:, bone] > 0) & (skinned.groups == group))
            if len(own):
                part = _part(skinned, own, shares[own, bone], places, near)
                log.info(
                    "layer %d, bone %d: %s, %d shapes", group, bone, part.fitted.choice, len(part.shapes)
                )
                parts.append(part)
    errors = np.array([part.fitted.error * np.sqrt(3) for part in parts])
    drivers = _drivers([part.fitted for part in parts], places)
    return Correctives(lower, upper, drivers, _vertex_shapes(parts, len(skinned.rest)), errors)


def _shares(skinned: Skinned, bones: int) -> Array:
    """Shares (n, b) of the bones' parts at the vertices: their weights, without the smallest ones."""
    shares = np.zeros((len(skinned.rest), bones))
    np.add.at(shares, (np.arange(len(shares))[:, None], skinned.joints), skinned.weights)
    shares[shares < LEAST_WEIGHT] = 0.0
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def _part(
    skinned: Skinned, own: IntArray, shares: Array, places: Array, near: list[tuple[int, ...]]
) -> _Part:
    """The part of vertices `own` (m,), in which each counts by its share (m,)."""
    roots = np.sqrt(shares)[:, None]
    values = (skinned.corrections[:, own] * roots).reshape(len(places), -1).astype(np.float64)
    found = fit_regression(places, values, near)
    # A vertex takes the part's shape by its share, of which the values have the square root already.
    return _Part(own, found.shapes.reshape(len(found.shapes), len(own), 3) * roots, found)


def _drivers(fitted: Sequence[Regression], places: Array) -> kernels.Drivers:
    chosen = [np.array(f.choice.angles, np.int64) for f in fitted]
    known, gains = [places[:, c].ravel() for c in chosen], [f.gains.ravel() for f in fitted]
    kinds = np.array([f.choice.kernel for f in fitted], float).reshape(-1, 2)
    ends = np.cumsum([0, *(len(f.shapes) for f in fitted)]).astype(np.int64)
    of_part = np.concatenate([np.zeros(0, np.int64), *chosen])
    flat = [np.concatenate([np.zeros(0), *arrays]) for arrays in (known, gains)]
    return kernels.Drivers(of_part, _ends(chosen), kinds, flat[0], _ends(known), flat[1], _ends(gains), ends)


def _vertex_shapes(parts: Sequence[_Part], count: int) -> kernels.VertexShapes:
    """The parts' shapes vertex by vertex, of `count` vertices."""
    vertex = np.concatenate([np.zeros(0, np.int64), *(part.vertices for part in parts)])
    owner = np.repeat(np.arange(len(parts)), [len(part.vertices) for part in parts])
    numbers = 3 * np.array([len(part.shapes) for part in parts], np.int64)[owner]
    order = np.lexsort((owner, vertex))
    starts = np.cumsum(numbers[order]) - numbers[order]
    first = np.empty(len(order), np.int64)
    first[order] = starts
    basis = np.zeros(int(numbers.sum()))
    for p, part in enumerate(parts):
        places = len(part.shapes) * np.arange(3)[:, None] + np.arange(len(part.shapes))
        basis[first[owner == p][:, None, None] + places] = part.shapes.transpose(1, 2, 0)
    rows = np.searchsorted(vertex[order], np.arange(count + 1)).astype(np.int32)
    return kernels.VertexShapes(rows, owner[order].astype(np.int32), starts.astype(np.int64), single(basis))


def _ends(arrays: Sequence[Array] | Sequence[IntArray]) -> IntArray:
    return np.cumsum([0, *(len(a) for a in arrays)]).astype(np.int64)
