"""Marks by distance, and what hangs on a thin neck: a bone in fat as bright as its marrow."""

import numpy as np
import pytest
from scipy import ndimage

from handpipe.imaging.segmentation.segmentation import (
    BACKGROUND,
    SegmentationSettings,
    segment_bone,
    without_necks,
)
from handpipe.imaging.volumes.volume import Volume

SPACING = 0.5


def bone_in_fat(hole: int):
    """Volume, true marrow and strokes: a ball of marrow in a dark shell of two voxels, in fat as bright."""
    i, j, k = np.indices((48, 48, 48)) - 24
    radius = np.sqrt(i**2 + j**2 + k**2)
    values = np.where((radius > 12) & (radius < 14.5), 0.1, 1.0)
    values[24 - hole : 24 + hole, 24 - hole : 24 + hole, 24:] = 1.0  # a way out of the marrow, as bright
    noise = np.random.default_rng(0).normal(0, 0.04, values.shape)
    blurred = ndimage.gaussian_filter(values, 0.5) + noise
    seeds = np.zeros(values.shape, np.uint8)
    seeds[20:29, 24, 24] = 1
    seeds[4:44, 6, 24] = BACKGROUND
    seeds[24, 6:42, 44] = BACKGROUND
    affine = np.diag([SPACING] * 3 + [1.0])
    return Volume(blurred.astype(np.float32), affine), radius < 12, seeds


def dice(volume, truth, seeds, settings):
    found = segment_bone(volume, seeds, 1, settings)
    claimed = np.zeros(truth.shape, bool)
    claimed[found.slices] = found.probability > 0.5
    return 2 * (claimed & truth).sum() / (claimed.sum() + truth.sum())


def test_a_hole_in_the_shell_does_not_leak_by_distance() -> None:
    volume, truth, seeds = bone_in_fat(hole=2)
    by_distance = dice(volume, truth, seeds, SegmentationSettings(marks="distance", neck=1.5))
    assert by_distance > 0.93


@pytest.mark.parametrize(("thick", "kept"), [(3, False), (9, True)])
def test_what_hangs_on_less_than_a_neck_is_cut_off(thick, kept) -> None:
    claimed = np.zeros((60, 24, 24), bool)
    claimed[2:24, 2:22, 2:22] = claimed[36:58, 2:22, 2:22] = True
    middle = slice(12 - thick // 2, 12 + thick // 2 + 1)
    claimed[24:36, middle, middle] = True
    strokes = np.zeros_like(claimed)
    strokes[10:14, 12, 12] = True
    cut = without_necks(claimed * 0.9, strokes, np.full(3, SPACING), neck=2.5) > 0.5
    assert cut[2:24].sum() > 0.97 * claimed[2:24].sum()
    assert bool(cut[36:].any()) is kept


def test_no_neck_changes_nothing() -> None:
    probability = np.random.default_rng(0).uniform(0, 1, (8, 8, 8))
    assert without_necks(probability, probability > 0.9, np.ones(3), 0.0) is probability
