"""Attachments of a body in a search for its shape: points at known places, and ends at unknown places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial.transform import Rotation

from handpipe.core import Array, IntArray
from handpipe.shapes.observations.attached import Attached


@dataclass(frozen=True)
class AttachmentTargets:
    """Points of a tet mesh that are attached, or that belong to loose ends.

    Attributes
    ----------
    matrix : (t, n)
        Weights of the mesh's vertices for each point.
    targets : (t, 3)
        Targets in mm.
    begun : (t, 3)
        First places of the points of loose ends, in mm.
    ends : tuple of (k,)
        Numbers (of the t) of the points of each loose end, which moves as a rigid body.
    """

    matrix: sparse.csr_matrix
    targets: Array
    begun: Array
    ends: tuple[IntArray, ...]

    @staticmethod
    def place(attached: Attached, loose: Sequence[sparse.csr_matrix], x: Array) -> AttachmentTargets:
        """Attached points, and loose ends by their matrices (t_i, n), at places of x (n, 3)."""
        matrix = sparse.vstack([attached.matrix, *loose], format="csr")
        targets = np.concatenate([attached.targets, *(end @ x for end in loose)])
        starts = np.cumsum([len(attached.targets), *(end.shape[0] for end in loose)])
        ends = tuple(np.arange(a, b) for a, b in zip(starts[:-1], starts[1:], strict=True))
        return AttachmentTargets(matrix, targets, targets, ends)

    @cached_property
    def wide(self) -> sparse.csr_matrix:
        """Matrix (3 t, 3 n) of the same weights for each coordinate."""
        return sparse.kron(self.matrix, sparse.eye(3), format="csr")

    def errors(self, x: Array) -> Array:
        """Offsets (t, 3) from the targets."""
        return np.asarray(self.matrix @ x - self.targets)

    def departures(self) -> Array:
        """Offsets (t, 3) of loose ends from their first places; zero for attached points."""
        return self.targets - self.begun

    def by_motions(self) -> Array:
        """Derivative (3 t, 6 k) of the targets by each loose end's turn (rad) about its middle and shift."""
        columns = np.zeros((len(self.targets), 3, 6 * len(self.ends)))
        for number, end in enumerate(self.ends):
            arms = self.targets[end] - self.targets[end].mean(axis=0)
            turns = np.cross(np.eye(3)[None], arms[:, None])  # (t, axis, 3)
            columns[end, :, 6 * number : 6 * number + 3] = turns.transpose(0, 2, 1)
            columns[end, :, 6 * number + 3 : 6 * number + 6] = np.eye(3)
        return columns.reshape(3 * len(self.targets), columns.shape[2])

    def moved(self, motions: Array) -> AttachmentTargets:
        """Loose ends turned and shifted by motions (6 k,)."""
        targets = self.targets.copy()
        for end, motion in zip(self.ends, motions.reshape(-1, 6), strict=True):
            middle = targets[end].mean(axis=0)
            targets[end] = Rotation.from_rotvec(motion[:3]).apply(targets[end] - middle) + middle + motion[3:]
        return replace(self, targets=targets)
