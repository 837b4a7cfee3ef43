"""One label a voxel out of the marrow of all bones; what two of them claim is shared (Wang 2019 §3.1)."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy import ndimage

from handpipe.core import IntArray
from handpipe.imaging.segmentation.random_walker import INSIDE, OUTSIDE, random_walker
from handpipe.imaging.segmentation.segmentation import BoneProbability, SegmentationSettings, bounds
from handpipe.imaging.volumes.volume import Labels, Volume, box

logger = logging.getLogger(__name__)

AROUND_CONFLICT = 4  # voxels of sure labels around a conflict


def merge(
    volume: Volume,
    bones: Mapping[int, BoneProbability],
    seeds: Labels,
    settings: SegmentationSettings,
) -> tuple[Labels, dict[int, BoneProbability]]:
    """Labels of all bones, and their probabilities with conflicts resolved.

    Voxels claimed by two bones become unlabelled. Each conflict is then solved again in a local region, with
    the sure voxels around it as seeds.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    bones : mapping of int to BoneProbability
        Probability of each bone's marrow by label; left unchanged.
    seeds : array (nx, ny, nz) of uint8
        Strokes: 0 for none, labels of bones, 255 for the background.
    settings : SegmentationSettings
        Settings of the random walker.

    Returns
    -------
    labels : array (nx, ny, nz) of uint8
        Label of each voxel, 0 for no bone.
    resolved : dict of int to BoneProbability
        Probabilities by label; at most one bone has more than 0.5 in a voxel of a conflict.

    Raises
    ------
    ConvergenceError
        If the random walker does not converge.

    References
    ----------
    Wang 2019 §3.1.
    """
    claims = np.zeros(volume.shape, np.uint8)
    labels = np.zeros(volume.shape, np.uint8)
    for label, bone in bones.items():
        claimed = bone.probability > 0.5
        claims[bone.slices] += claimed
        labels[bone.slices][claimed] = label
    labels[claims > 1] = 0
    resolved = {label: replace(bone, probability=bone.probability.copy()) for label, bone in bones.items()}
    disputed = claims > 1
    if not disputed.any():
        return labels, resolved
    first, last = bounds(disputed)
    conflicts, count = ndimage.label(disputed[box(first, last)])
    for number, slices in enumerate(ndimage.find_objects(conflicts), 1):
        logger.info("resolving conflict %d of %d between bones", number, count)
        index = np.argwhere(conflicts[slices] == number) + [s.start for s in slices] + first
        _resolve(volume, labels, index, seeds, resolved, settings)
    return labels, resolved


def _resolve(
    volume: Volume,
    labels: Labels,
    index: IntArray,
    seeds: Labels,
    bones: Mapping[int, BoneProbability],
    settings: SegmentationSettings,
) -> None:
    """Share a conflict's voxels (m, 3) among the bones, by a walker for each; sets labels, probabilities."""
    lower = np.maximum(index.min(0) - AROUND_CONFLICT, 0)
    local = volume.crop(lower, index.max(0) + 1 + AROUND_CONFLICT)
    region = box(lower, lower + local.shape)
    free = np.zeros(local.shape, bool)
    free[tuple((index - lower).T)] = True
    rivals = [k for k in bones if (labels[region] == k).any() or (bones[k].at(index) > 0.5).any()]
    values = local.values / np.median(local.values[free])
    chances = []
    for label in rivals:
        sure = np.where((labels[region] == label) | (seeds[region] == label), INSIDE, OUTSIDE)
        marks = np.where(free, 0, sure)
        chances.append(random_walker(values, marks, settings.beta, spacing=local.spacing)[free])
    winner = np.array([0, *rivals], np.uint8)[np.argmax([np.full(len(index), 0.5), *chances], axis=0)]
    labels[tuple(index.T)] = winner
    for label, chance in zip(rivals, chances, strict=True):
        # One owner, to the last digit of what is written.
        bones[label].set(index, np.where(winner == label, chance, np.minimum(chance, 0.5)))
