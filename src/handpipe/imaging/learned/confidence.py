"""How far the strokes decide a bone: halves of them must give the same bone.

The strokes are split into two halves, block by block. Each half alone teaches the look and seeds the walkers.
A bone whose border the image and the look decide comes out the same; the strokes that were left out test it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from handpipe.core import Array, BoolArray
from handpipe.imaging.segmentation import BACKGROUND
from handpipe.imaging.volumes import Labels

BLOCK = 12.0  # mm, of the strokes that are left out together
BLOCKS = 4  # along a bone at least
NEAR = 6.0  # mm from a bone: strokes of the background there say where it ends
LEAST_AGREEMENT = 0.8
MOST_MISSED = 0.2  # of the strokes left out


@dataclass(frozen=True)
class Confidence:
    """How far the strokes decide a bone.

    Parameters
    ----------
    agreement : float
        Smaller Dice coefficient of the bone by half of the strokes with the bone by all of them.
    missed : float
        Share of the strokes that were left out, its own and the background's within `NEAR`, that end on the
        wrong side.
    """

    agreement: float
    missed: float

    def doubts(self) -> list[str]:
        """Doubts about the bone, in words, with what to draw; empty if there are none."""
        found = []
        if self.agreement < LEAST_AGREEMENT:
            found.append(f"half of its strokes give another bone (Dice {self.agreement:.2f})")
        if self.missed > MOST_MISSED:
            found.append(f"{100 * self.missed:.0f} % of the strokes left out end on the wrong side of it")
        return [f"{text}: draw strokes along both sides of its border" for text in found]


def halves(seeds: Labels, spacing: Array) -> tuple[Labels, Labels]:
    """The strokes of a label volume in two halves: blocks in turn, smaller ones for small bones."""
    first, second = np.zeros_like(seeds), np.zeros_like(seeds)
    for label in np.setdiff1d(np.unique(seeds), [0]):
        index = np.argwhere(seeds == label)
        place = (index - index.min(axis=0)) * spacing
        block = min(BLOCK, max(float(place.max()) / BLOCKS, float(spacing.max())))
        odd = np.floor(place / block).sum(axis=1) % 2 == 1
        first[tuple(index[~odd].T)] = label
        second[tuple(index[odd].T)] = label
    return first, second


def confidence(
    whole: Labels, parts: tuple[Labels, Labels], kept: tuple[Labels, Labels], label: int, spacing: Array
) -> Confidence:
    """How far the strokes decide one bone.

    Parameters
    ----------
    whole : array (nx, ny, nz) of uint8
        Labels by all strokes.
    parts : tuple of 2 arrays (nx, ny, nz) of uint8
        Labels by each half of the strokes.
    kept : tuple of 2 arrays (nx, ny, nz) of uint8
        The halves.
    label : int
        Label of the bone.
    spacing : array (3,)
        Size of a voxel in mm.

    Returns
    -------
    Confidence
        Agreement, and strokes on the wrong side.
    """
    bone = whole == label
    if not bone.any():
        return Confidence(0.0, 1.0)
    near = ndimage.distance_transform_edt(~bone, sampling=spacing) < NEAR
    wrong = tested = 0
    for part, other in zip(parts, kept[::-1], strict=True):
        own, outside = other == label, (other == BACKGROUND) & near
        wrong += int((own & (part != label)).sum() + (outside & (part == label)).sum())
        tested += int(own.sum() + outside.sum())
    return Confidence(min(_dice(bone, part == label) for part in parts), wrong / max(tested, 1))


def _dice(a: BoolArray, b: BoolArray) -> float:
    return float(2 * (a & b).sum() / max(int(a.sum() + b.sum()), 1))
