"""Hooks: points that a tendon slides through, with pose-space corrections (sec. 5.4).

Bones or the flesh carry them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handpipe.core import Array, IntArray, RigidTransform, Shape
from handpipe.mesh.surfaces import Distance, Surface
from handpipe.mesh.tets import Embedding, TetMesh
from handpipe.skeleton.posing import blend_linearly
from handpipe.tissues.tendons.rods.rod import arc_length, closest_on_rod, point_at, unit

Bones = Mapping[str, RigidTransform]
TOLD = 0.2  # mm (rms), by which two bones have to carry a hook apart in the examples, to tell its weights
JOINT = 5.0  # mm between the distances of two bones, beyond which the closer one alone carries a hook


@dataclass(frozen=True)
class InFlesh:
    """Hooks (e,) that the flesh carries, and where they lie in its tets."""

    hooks: IntArray
    embedding: Embedding


@dataclass(frozen=True)
class HookSet:
    """rest (k, 3) on the neutral rod; weights (k, n_bones) in the order of `bones`; corrections (N, k, 3).

    In mm, all in the frame of the base bone, the last of `bones`. Bones carry hooks by linear blend skinning,
    but those `in_flesh`: what else pushes the flesh, an opposed thumb, pushes these.
    """

    bones: tuple[str, ...]
    rest: Array
    weights: Array
    corrections: Array
    in_flesh: InFlesh | None = None

    def carried(self, bones: Bones, flesh: Array | None = None) -> Array:
        """Positions (k, 3) without corrections; flesh (n, 3): vertices of its mesh, relative to the base."""
        points = blend_linearly(self.rest, self.weights, {name: bones[name] for name in self.bones})
        if self.in_flesh is not None:
            if flesh is None:
                raise ValueError("some hooks lie in the flesh; its vertices are not given")
            points[self.in_flesh.hooks] = self.in_flesh.embedding(flesh)
        return points

    def to_group(self) -> dict[str, Any]:
        """Content for an artifact's group."""
        group = {"rest": self.rest, "weights": self.weights, "corrections": self.corrections}
        if self.in_flesh is None:
            return group
        embedding = self.in_flesh.embedding
        inside = {"hooks": self.in_flesh.hooks, "cells": embedding.cells, "weights": embedding.weights}
        return {**group, "flesh": inside}

    @staticmethod
    def from_group(group: Mapping[str, Any], bones: tuple[str, ...]) -> HookSet:
        """What `to_group` gave, as an artifact returned it; the bones that the tendon passes."""
        in_flesh = None
        if "flesh" in group:
            inside = group["flesh"]
            in_flesh = InFlesh(inside["hooks"], Embedding(inside["cells"], inside["weights"]))
        return HookSet(bones, group["rest"], group["weights"], group["corrections"], in_flesh)


def sample_hooks(
    rest: Array, bones: Mapping[str, Surface], spacing: float = 4.0, near_joints: float = 1.5
) -> Array:
    """Points (k, 3) on a rod, every `spacing` mm, or `near_joints` mm where two bones are about as close."""
    arc = arc_length(rest)
    distances = np.sort(bone_distances(rest, bones), axis=1)
    at_joint = (
        distances[:, 1] - distances[:, 0] < 5.0 if distances.shape[1] > 1 else np.zeros(len(rest), bool)
    )
    rate = np.where(at_joint, 1.0 / near_joints, 1.0 / spacing)
    counted = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(arc))])
    count = max(int(counted[-1]), 2)
    at = np.interp((np.arange(count) + 0.5) * counted[-1] / count, counted, arc)
    return np.stack([np.interp(at, arc, rest[:, c]) for c in range(3)], axis=1)


def bone_distances(points: Array, bones: Mapping[str, Surface]) -> Array:
    """Signed distances (n, n_bones) in mm of points to bones in the same pose, negative inside."""
    return np.stack([Distance(surface).signed(points)[0] for surface in bones.values()], axis=1)


def past_end(x: Array, reach: float = 40.0) -> Array:
    """A rod with a straight continuation past its free end, where hooks that it has slid out of still lie."""
    return np.vstack([x, x[-1] + reach * unit(x[-1] - x[-2])])


def closest_points(points: Array, x: Array) -> Array:
    """Closest points (k, 3) of a polyline."""
    segment, t, _ = closest_on_rod(points, x)
    return point_at(x, segment, t)


def fit_weights(
    rest: Array,
    pair: IntArray,
    given: Array,
    rods: Sequence[Array],
    poses: Sequence[Sequence[RigidTransform]],
    *,
    tolerance: float = 1e-4,
    max_iterations: int = 200,
) -> Array:
    """Skinning weights (k,) of the first bone of each hook's pair (k, 2) (Eq. 19-21).

    The second bone has the rest. Points rest (k, 3), example rods (Q+1, 3), and transforms of each pose by
    bone number. Closest points on the rods are found again after each closed-form minimisation, from weight
    one on the closest bone. Where the examples hardly move one bone of a pair against the other, they tell
    nothing of the weight: it stays as `given` (k,).
    """
    moved = np.stack([[t(rest) for t in pose] for pose in poses])  # (N, n_bones, k, 3)
    k = np.arange(len(rest))
    first, second = moved[:, pair[:, 0], k], moved[:, pair[:, 1], k]
    apart = first - second
    size = np.sum(apart**2, axis=(0, 2))
    told = size > len(poses) * TOLD**2
    size = np.where(told, size, 1.0)
    extended = [past_end(x) for x in rods]
    weight = np.where(told, 1.0, given)
    for _ in range(max_iterations):
        hooks = weight[:, None] * first + (1.0 - weight)[:, None] * second
        feet = np.stack([closest_points(h, x) for h, x in zip(hooks, extended, strict=True)])
        fitted = np.clip(np.sum(apart * (feet - second), axis=(0, 2)) / size, 0.0, 1.0)
        fitted = np.where(told, fitted, given)
        done = np.abs(fitted - weight).max() <= tolerance
        weight = fitted
        if done:
            break
    return weight


def fit_hooks(
    rest: Array,
    neutral_bones: Mapping[str, Surface],
    order: tuple[str, ...],
    rods: Sequence[Array],
    poses: Sequence[Bones],
    flesh: Sequence[Shape] = (),
) -> HookSet:
    """Hooks of a tendon from its rods (Q+1, 3) in the example poses, N_s = 2 closest bones each (sec. 5.4).

    `rods`, `poses` and the flesh in each pose relative to the base bone, the last of `order`. A correction is
    the vector from the carried hook to the closest point of the pose's rod. Where there is flesh, it carries
    the hooks that it needs to correct less than the bones do: pulleys hold a finger's tendons, not a palm's.
    """
    surfaces = {name: neutral_bones[name] for name in order}
    points = sample_hooks(rest, surfaces)
    by_pose = [[pose[name] for name in order] for pose in poses]
    weights = np.zeros((len(points), len(order)))
    if len(order) == 1 or not poses:
        weights[np.arange(len(points)), np.argmin(bone_distances(points, surfaces), axis=1)] = 1.0
    else:
        distances = bone_distances(points, surfaces)
        pair = np.argsort(distances, axis=1)[:, :2]
        nearer, farther = np.take_along_axis(distances, pair, axis=1).T
        given = np.clip(0.5 + 0.5 * (farther - nearer) / JOINT, 0.0, 1.0)
        share = fit_weights(points, pair, given, rods, by_pose)
        weights[np.arange(len(points)), pair[:, 0]] = share
        weights[np.arange(len(points)), pair[:, 1]] = 1.0 - share
    lines = [past_end(rod) for rod in rods]
    carried = [blend_linearly(points, weights, {name: pose[name] for name in order}) for pose in poses]
    on_bones = _missing(carried, lines)
    if not flesh or len(poses) < 2:  # neutral alone does not tell what carries a hook
        return HookSet(order, points, weights, on_bones)
    embedding = Embedding.embed(points, TetMesh(flesh[0].rest, flesh[0].cells))
    inside = _missing([embedding(shape.vertices) for shape in flesh], lines)
    better = np.sum(inside**2, axis=(0, 2)) < np.sum(on_bones**2, axis=(0, 2))
    chosen = np.flatnonzero(better)
    in_flesh = InFlesh(chosen, embedding.chosen(chosen))
    return HookSet(order, points, weights, np.where(better[:, None], inside, on_bones), in_flesh)


def _missing(carried: Sequence[Array], lines: Sequence[Array]) -> Array:
    """Vectors (N, k, 3) from points (k, 3) in N poses to the closest points of their rods."""
    found = [closest_points(x, line) - x for x, line in zip(carried, lines, strict=True)]
    return np.array(found).reshape(len(lines), -1, 3)
