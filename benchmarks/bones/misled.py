"""Seeds that lie where their bone is not, as a hand slips or a name is mistaken."""

from __future__ import annotations

from typing import Literal

import numpy as np

from handpipe.core import Array
from handpipe.imaging.volumes.volume import Labels
from handpipe.synthetic.acquisition.image import VoxelGrid
from handpipe.synthetic.phantom.posed_hand import PosedHand

Seeding = Literal["in marrow", "in the neighbour", "in fat", "partly in fat"]
LENGTH = 8.0  # mm of the wrong stroke
BESIDE = 1.6  # mm from the bone's side to a stroke in fat


def mislead(
    drawn: Labels, label: int, bone: str, neighbour: str, seeded: Seeding, posed: PosedHand, grid: VoxelGrid
) -> None:
    """Change the seeds (nx, ny, nz) of one bone in place.

    seeded: one stroke along the middle of a neighbour's marrow, or in the fat beside the bone, for the
    bone's own seeds; "partly in fat" draws it beside them.
    """
    if seeded != "partly in fat":
        drawn[drawn == label] = 0
    if seeded == "in the neighbour":
        line = _stroke(posed.marrow[neighbour][0], np.zeros(3))
    else:
        line = _stroke(posed.bones[bone][0], _beside(posed, bone))
    voxels = np.unique(np.round(grid.indices(line)).astype(np.int64), axis=0)
    inside = voxels[((voxels >= 0) & (voxels < grid.shape)).all(axis=1)]
    drawn[tuple(inside.T)] = label


def _stroke(points: Array, shift: Array) -> Array:
    """Points (n, 3) along the long axis of points (k, 3), about their middle moved by a shift (3,)."""
    middle = points.mean(axis=0)
    along = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    return middle + shift + np.linspace(-0.5, 0.5, 60)[:, None] * LENGTH * along


def _beside(posed: PosedHand, bone: str) -> Array:
    """From a bone's middle to the fat on its radial side (3,): no tendon runs there."""
    points = posed.bones[bone][0] - posed.bones[bone][0].mean(axis=0)
    side = posed.transforms[bone].rotation @ np.array([0.0, 1.0, 0.0])
    distance = np.linalg.norm(points, axis=1)
    middle = points[distance < np.quantile(distance, 0.2)] @ side
    return side * (middle.max() + BESIDE)
