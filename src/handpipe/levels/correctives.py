"""Correctives before skinning: each bone's part of a layer has shapes that the joints near it drive."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from handpipe.core import Array, Int32Array, IntArray
from handpipe.levels import kernels
from handpipe.levels.regression import fit_regression

log = logging.getLogger(__name__)
LEAST_WEIGHT = 0.02  # of a bone at a vertex that its part has
SINGULAR = 0.1  # determinant of a blend of motions below which its inverse is damped
DAMPING = 0.0025  # added to the squared singular values of such a blend


@dataclass(frozen=True, eq=False)
class Correctives:
    """Shapes of all parts, and the regressions that drive them, as `handpipe.levels.kernels` takes them.

    lower, upper (a,): range of the learned angles in rad; the other arrays are those of
    `kernels.coefficients` and `kernels.correct`; errors (p,): left-out root mean square in mm.
    """

    lower: Array
    upper: Array
    of_part: IntArray
    at: IntArray
    kinds: Array
    known: Array
    known_at: IntArray
    gains: Array
    gains_at: IntArray
    ends: IntArray
    errors: Array
    rows: Int32Array
    parts: Int32Array
    starts: IntArray
    basis: Array

    def amounts(self, angles: Array) -> Array:
        """Coefficients (K,) of the shapes at angles (a,) in rad, in single precision."""
        out = np.zeros(self.ends[-1])
        kernels.coefficients(
            scaled(angles, self.lower, self.upper), self.of_part, self.at, self.kinds, self.known,
            self.known_at, self.gains, self.gains_at, self.ends, out,
        )  # fmt: skip
        return out.astype(np.float32)

    def add(self, rest: Array, angles: Array, out: Array) -> None:
        """Neutral points (n, 3) with the shapes at angles (a,) in rad added, into out (n, 3), mm."""
        amounts = self.amounts(angles)
        kernels.correct(rest, self.rows, self.parts, self.starts, self.basis, self.ends, amounts, out)

    def of_vertices(self, which: IntArray) -> Correctives:
        """The same for some of the vertices, by their numbers."""
        counts = np.diff(self.rows)[which]
        rows = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        kept = np.repeat(self.rows[which] - rows[:-1], counts) + np.arange(rows[-1])
        return replace(self, rows=rows, parts=self.parts[kept], starts=self.starts[kept])

    def with_plain(self, count: int) -> Correctives:
        """The same with further vertices that nothing is added to."""
        return replace(self, rows=np.append(self.rows, np.full(count, self.rows[-1], np.int32)))

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        return asdict(self)

    @staticmethod
    def from_group(group: Mapping[str, Any]) -> Correctives:
        """What `to_group` gave, as an artifact returned it."""
        return Correctives(**{name: np.ascontiguousarray(value) for name, value in group.items()})


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


def learn_correctives(
    skinned: Skinned, angles: Array, neighbourhoods: Mapping[int, list[tuple[int, ...]]]
) -> Correctives:
    """Correctives of frames at angles (F, a) in rad.

    neighbourhoods: numbers of angles that may drive a bone's part, by its number; the fewest first.
    """
    lower, upper = angles.min(axis=0), angles.max(axis=0)
    places = scaled(angles, lower, upper)
    dense = np.zeros((len(skinned.rest), max(neighbourhoods, default=0) + 1))
    np.add.at(dense, (np.arange(len(dense))[:, None], skinned.joints), skinned.weights)
    dense[dense < LEAST_WEIGHT] = 0.0
    dense /= dense.sum(axis=1, keepdims=True)
    wanted = [(group, bone) for group in np.unique(skinned.groups) for bone in neighbourhoods]
    fitted, owned, blocks = [], [], []
    for group, bone in wanted:
        own = np.flatnonzero((dense[:, bone] > 0) & (skinned.groups == group))
        if len(own) == 0:
            continue
        share = np.sqrt(dense[own, bone])[:, None]
        values = (skinned.corrections[:, own] * share).reshape(len(angles), -1).astype(float)
        found = fit_regression(places, values, neighbourhoods[bone])
        fitted.append(found)
        owned.append(own)
        # The vertex takes this part's shape by its weight; the square root above undoes half of it.
        blocks.append(found.shapes.reshape(len(found.shapes), len(own), 3) * share)
        log.info("layer %d, bone %d: %s, %d shapes", group, bone, found.choice, len(found.shapes))
    ends = np.cumsum([0, *(len(f.shapes) for f in fitted)])
    vertex = np.concatenate([np.zeros(0, np.int64), *owned])
    part = np.concatenate([np.zeros(0, np.int64), *(np.full(len(o), p) for p, o in enumerate(owned))])
    order = np.lexsort((part, vertex))
    lengths = 3 * (ends[part + 1] - ends[part])
    starts = np.cumsum([0, *lengths[order]])[:-1]
    basis = np.zeros(int(lengths.sum()), np.float32)
    first = np.empty(len(order), np.int64)
    first[order] = starts
    for p, block in enumerate(blocks):
        if len(block):
            to = first[part == p][:, None, None] + 3 * np.arange(len(block))[:, None] + np.arange(3)
            basis[to] = block.transpose(1, 0, 2)
    chosen = [np.array(f.choice.angles, np.int64) for f in fitted]
    known = [places[:, c].ravel() for c in chosen]
    gains = [f.gains.ravel() for f in fitted]
    return Correctives(
        lower,
        upper,
        np.concatenate([np.zeros(0, np.int64), *chosen]),
        _ends(chosen),
        np.array([f.choice.kernel for f in fitted], float).reshape(-1, 2),
        np.concatenate([np.zeros(0), *known]),
        _ends(known),
        np.concatenate([np.zeros(0), *gains]),
        _ends(gains),
        ends.astype(np.int64),
        np.array([f.error * np.sqrt(3) for f in fitted]),
        np.searchsorted(vertex[order], np.arange(len(skinned.rest) + 1)).astype(np.int32),
        part[order].astype(np.int32),
        starts.astype(np.int64),
        basis,
    )


def _ends(arrays: list[Array] | list[IntArray]) -> IntArray:
    return np.cumsum([0, *(len(a) for a in arrays)]).astype(np.int64)
