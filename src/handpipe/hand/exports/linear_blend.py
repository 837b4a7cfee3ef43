"""Linear blend skinning by four bones a vertex, and the shapes before it that give those after it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from handpipe.core import Array, IntArray, RigidTransform
from handpipe.mesh.surfaces import Surface
from handpipe.skeleton.posing import bone_weights

BONES_A_VERTEX = 4  # bones a vertex, as much as every program reads
LEAST_DET = 1e-3  # of a blend of rotations: below, a vertex is not corrected


@dataclass(frozen=True, eq=False)
class LinearBlend:
    """Vertices whose motion is a weighted mean of the motions of four bones.

    Parameters
    ----------
    joints : array (n, 4) of int
        Numbers of the bones.
    weights : array (n, 4)
        Their weights, which sum to 1.
    """

    joints: IntArray
    weights: Array

    @staticmethod
    def rigid(count: int, joint: int) -> LinearBlend:
        """All of `count` vertices on one bone."""
        joints = np.zeros((count, BONES_A_VERTEX), np.int64)
        joints[:, 0] = joint
        return LinearBlend(joints, np.tile([1.0, 0, 0, 0], (count, 1)))

    @staticmethod
    def near(points: Array, bones: Mapping[str, Surface]) -> LinearBlend:
        """Weights of neutral points (n, 3) in mm by their distance to each bone's neutral surface."""
        weights = bone_weights(points, bones)
        weights = np.pad(weights, [(0, 0), (0, max(BONES_A_VERTEX - weights.shape[1], 0))])
        joints = np.argsort(-weights, axis=1, kind="stable")[:, :BONES_A_VERTEX]
        chosen = np.take_along_axis(weights, joints, axis=1)
        joints = np.where(chosen > 0, joints, 0)
        return LinearBlend(joints, chosen / chosen.sum(axis=1, keepdims=True))

    def __call__(self, points: Array, motions: Sequence[RigidTransform]) -> Array:
        """Points (n, 3) in mm moved by the motions of all bones."""
        turns, shifts = self._blended(motions)
        return np.einsum("nij,nj->ni", turns, points) + shifts

    def before(self, moved: Array, motions: Sequence[RigidTransform], rest: Array) -> Array:
        """Points (n, 3) in mm that the motions take to `moved`; `rest` where their blend is singular."""
        turns, shifts = self._blended(motions)
        good = np.linalg.det(turns) > LEAST_DET
        found = np.array(rest, dtype=np.float64)
        found[good] = np.linalg.solve(turns[good], (moved - shifts)[good][:, :, None])[:, :, 0]
        return found

    def _blended(self, motions: Sequence[RigidTransform]) -> tuple[Array, Array]:
        """Matrices (n, 3, 3) and translations (n, 3)."""
        rotations = np.stack([m.rotation for m in motions])
        translations = np.stack([m.translation for m in motions])
        turns = np.einsum("nk,nkij->nij", self.weights, rotations[self.joints])
        return turns, np.einsum("nk,nki->ni", self.weights, translations[self.joints])
