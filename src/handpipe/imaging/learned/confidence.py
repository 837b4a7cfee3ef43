"""How far the strokes decide a bone: other ways to learn from them must give the same bone.

The strokes are split into two halves, block by block. Each half alone teaches the look and seeds the walkers,
and the strokes that were left out test the bone. Once more, all strokes teach looks alone, wherever a voxel
is. A bone whose border the image and the look decide comes out the same; where a border has no strokes on its
other side, nothing tells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from handpipe.core import Array, BoolArray
from handpipe.imaging.segmentation import BACKGROUND
from handpipe.imaging.volumes import Labels

BLOCK = 12.0  # mm, of the strokes that are left out together
BLOCKS = 4  # along a bone at least
NEAR = 6.0  # mm from a bone: strokes of the background there say where it ends
BESIDE = 4.0  # mm from a border: strokes there hold it
LEAST_AGREEMENT = 0.8  # bones of the real foot have 0.83 and more
LEAST_PLAIN = 0.9  # these have 0.93 and more
MOST_MISSED = 0.2  # of the strokes left out
MOST_BARE = 0.9  # of the border


class Confidence(NamedTuple):
    """How far the strokes decide a bone.

    Parameters
    ----------
    agreement : float
        Smaller Dice coefficient of the bone by half of the strokes with the bone by all of them.
    plain : float
        Dice coefficient of the bone by looks alone, wherever a voxel is.
    missed : float
        Share of the strokes that were left out, its own and the background's within `NEAR`, that end on the
        wrong side.
    bare : float
        Share of its border that has no stroke of the background or of another bone within `BESIDE`.
    """

    agreement: float
    plain: float
    missed: float
    bare: float

    def doubts(self) -> list[str]:
        """Doubts about the bone, in words, with what to draw; empty if there are none."""
        found = []
        if self.agreement < LEAST_AGREEMENT:
            found.append(f"half of its strokes give another bone (Dice {self.agreement:.2f})")
        if self.plain < LEAST_PLAIN:
            found.append(f"its look alone gives another bone (Dice {self.plain:.2f})")
        if self.missed > MOST_MISSED:
            found.append(f"{100 * self.missed:.0f} % of the strokes left out end on the wrong side of it")
        if self.bare > MOST_BARE:
            found.append(f"{100 * self.bare:.0f} % of its border has no strokes of the background beside it")
        return [f"{', '.join(found)}: draw strokes along both sides of its border"] if found else []


class Runs(NamedTuple):
    """Labels (nx, ny, nz) of uint8 by all strokes (`whole`), by looks alone (`plain`) and by each half.

    `seeds` are all strokes, `kept` the two halves, `parts` what each of these gives.
    """

    seeds: Labels
    whole: Labels
    plain: Labels
    kept: tuple[Labels, Labels]
    parts: tuple[Labels, Labels]


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


def confidence(runs: Runs, label: int, spacing: Array) -> Confidence:
    """How far the strokes decide one bone, on voxels of `spacing` (3,) in mm."""
    bone = runs.whole == label
    if not bone.any():
        return Confidence(0.0, 0.0, 1.0, 1.0)
    distance = ndimage.distance_transform_edt(~bone, sampling=spacing)
    wrong = tested = 0
    for part, other in zip(runs.parts, runs.kept[::-1], strict=True):
        own, outside = other == label, (other == BACKGROUND) & (distance < NEAR)
        wrong += int((own & (part != label)).sum() + (outside & (part == label)).sum())
        tested += int(own.sum() + outside.sum())
    agreement = min(_dice(bone, part == label) for part in runs.parts)
    bare = _bare(bone, (runs.seeds > 0) & (runs.seeds != label), spacing)
    return Confidence(agreement, _dice(bone, runs.plain == label), wrong / max(tested, 1), bare)


def _bare(bone: BoolArray, others: BoolArray, spacing: Array) -> float:
    """Share of a bone's border without other strokes beside it; the image's border is none."""
    border = bone & ~ndimage.binary_erosion(bone, border_value=1)
    if not border.any() or not others.any():
        return 1.0
    return float((ndimage.distance_transform_edt(~others, sampling=spacing)[border] > BESIDE).mean())


def _dice(a: BoolArray, b: BoolArray) -> float:
    return float(2 * (a & b).sum() / max(int(a.sum() + b.sum()), 1))
