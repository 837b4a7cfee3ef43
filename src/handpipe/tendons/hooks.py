"""Hooks: points that a tendon slides through, carried by the flesh or by bones, with pose-space corrections
(sec. 5.4).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from handpipe.mesh.distance import Distance
from handpipe.mesh.embedding import Embedding
from handpipe.mesh.rigid import RigidTransform
from handpipe.mesh.surface import Surface
from handpipe.mesh.tetrahedra import TetMesh
from handpipe.tendons.rod import Array, arc_length, closest_on_rod, point_at, unit

Bones = Mapping[str, RigidTransform]
IntArray = NDArray[np.int64]


class Interpolation(Protocol):
    """What hooks need of a pose space."""

    def interpolate(self, values: NDArray, bones: Bones) -> NDArray:
        """Values (N, ...) at the N example poses, interpolated at a pose (...)."""
        ...


@dataclass(frozen=True)
class Skinned:
    """Points rest (k, 3) that bones carry by linear blend skinning; weights (k, n_bones), in their order."""

    bones: tuple[str, ...]
    rest: Array
    weights: Array

    def __call__(self, bones: Bones, flesh: Array | None) -> Array:
        """Positions (k, 3); the flesh is not asked."""
        moved = np.stack([bones[name](self.rest) for name in self.bones])
        return np.einsum("kb,bkj->kj", self.weights, moved)


@dataclass(frozen=True)
class Embedded:
    """Points that the flesh carries: what bones push aside, an opposed thumb's ball, pushes tendons, too."""

    embedding: Embedding

    def __call__(self, bones: Bones, flesh: Array | None) -> Array:
        """Positions (k, 3) in the flesh, whose vertices are (n, 3)."""
        if flesh is None:
            raise ValueError("these hooks lie in the flesh; its vertices are not given")
        return self.embedding(flesh)


@dataclass(frozen=True)
class HookSet:
    """What carries k hooks, and corrections (N, k, 3) at N example poses.

    In mm, all in the frame of the base bone, the last that the tendon passes.
    """

    carrier: Skinned | Embedded
    corrections: Array

    def positions(self, bones: Bones, space: Interpolation, flesh: Array | None = None) -> Array:
        """Positions (k, 3) with the interpolated corrections; bones and flesh (n, 3) relative to the base."""
        return self.carrier(bones, flesh) + space.interpolate(self.corrections, bones)

    def to_group(self) -> dict[str, Array | IntArray]:
        """Content for an artifact's group."""
        carrier = self.carrier
        if isinstance(carrier, Skinned):
            return {"rest": carrier.rest, "weights": carrier.weights, "corrections": self.corrections}
        embedding = carrier.embedding
        return {"cells": embedding.cells, "weights": embedding.weights, "corrections": self.corrections}

    @staticmethod
    def from_group(group: Mapping[str, NDArray], bones: tuple[str, ...]) -> HookSet:
        """What `to_group` gave, as an artifact returned it; the bones that the tendon passes."""
        if "cells" in group:
            return HookSet(Embedded(Embedding(group["cells"], group["weights"])), group["corrections"])
        return HookSet(Skinned(bones, group["rest"], group["weights"]), group["corrections"])


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
    pair: NDArray[np.int64],
    rods: Sequence[Array],
    poses: Sequence[Sequence[RigidTransform]],
    *,
    tolerance: float = 1e-4,
    max_iterations: int = 200,
) -> Array:
    """Skinning weights (k,) of the first bone of each hook's pair (k, 2) (Eq. 19-21).

    The second bone has the rest. Points rest (k, 3), example rods (Q+1, 3), and transforms of each pose by
    bone number. Closest points on the rods are found again after each closed-form minimisation, from weight
    one on the closest bone.
    """
    moved = np.stack([[t(rest) for t in pose] for pose in poses])  # (N, n_bones, k, 3)
    k = np.arange(len(rest))
    first, second = moved[:, pair[:, 0], k], moved[:, pair[:, 1], k]
    apart = first - second
    size = np.maximum(np.sum(apart**2, axis=(0, 2)), 1e-12)
    extended = [past_end(x) for x in rods]
    weight = np.ones(len(rest))
    for _ in range(max_iterations):
        hooks = weight[:, None] * first + (1.0 - weight)[:, None] * second
        feet = np.stack([closest_points(h, x) for h, x in zip(hooks, extended, strict=True)])
        fitted = np.clip(np.sum(apart * (feet - second), axis=(0, 2)) / size, 0.0, 1.0)
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
    mesh: TetMesh | None = None,
    flesh: Sequence[Array | None] = (),
) -> HookSet:
    """Hooks of a tendon from its rods (Q+1, 3) in the example poses.

    The neutral flesh `mesh` carries them, with vertices `flesh` (n, 3) in each pose; without one, the
    N_s = 2 closest bones of each (sec. 5.4). All relative to the base bone, the last of `order`. A correction
    is the vector from the carried hook to the closest point of the pose's rod.
    """
    points = sample_hooks(rest, {name: neutral_bones[name] for name in order})
    carrier: Skinned | Embedded
    if mesh is None:
        carrier, flesh = _skinned(points, neutral_bones, order, rods, poses), [None] * len(poses)
    else:
        carrier = Embedded(Embedding.of(points, mesh))
    corrections = np.zeros((len(poses), len(points), 3))
    for n, (rod, bones, around) in enumerate(zip(rods, poses, flesh, strict=True)):
        carried = carrier(bones, around)
        corrections[n] = closest_points(carried, past_end(rod)) - carried
    return HookSet(carrier, corrections)


def _skinned(
    points: Array,
    neutral_bones: Mapping[str, Surface],
    order: tuple[str, ...],
    rods: Sequence[Array],
    poses: Sequence[Bones],
) -> Skinned:
    distances = bone_distances(points, {name: neutral_bones[name] for name in order})
    k, weights = np.arange(len(points)), np.zeros((len(points), len(order)))
    if len(order) == 1 or not poses:
        weights[k, np.argmin(distances, axis=1)] = 1.0
    else:
        pair = np.argsort(distances, axis=1)[:, :2]
        share = fit_weights(points, pair, rods, [[pose[name] for name in order] for pose in poses])
        weights[k, pair[:, 0]] = share
        weights[k, pair[:, 1]] = 1.0 - share
    return Skinned(order, points, weights)
