"""Bones of an image whose tissues the strokes teach: nothing is assumed of marrow, cortex or cartilage."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import ndimage

from handpipe.core import InputError, IntArray
from handpipe.imaging.learned.classifier import NEARBY, learn
from handpipe.imaging.learned.competition import compete
from handpipe.imaging.learned.confidence import Confidence, Runs, confidence, halves
from handpipe.imaging.learned.features import features, relative
from handpipe.imaging.learned.share import BoneShare, labelled
from handpipe.imaging.segmentation import BACKGROUND, BoneProbability
from handpipe.imaging.volumes import Labels, Volume, box

logger = logging.getLogger(__name__)

REACH = 20.0  # mm from the bones' strokes that voxels are looked at
FEWEST = 20  # voxels of strokes that teach a look


def segment_learned(
    channels: Sequence[Volume], seeds: Labels, bones: Mapping[str, int]
) -> tuple[dict[str, BoneProbability], dict[str, str]]:
    """All bones of one pose from strokes that teach how its tissues look.

    A classifier learns from the strokes which looks are bone. All bones and the background then compete by
    random walkers. The same by each half of the strokes, and by looks alone wherever a voxel is, tells how
    far the strokes decide each bone.

    Parameters
    ----------
    channels : sequence of Volume
        Images of the pose on one grid: echoes, or fat and water.
    seeds : array (nx, ny, nz) of uint8
        Strokes: 0 for none, labels of bones, 255 for the background.
    bones : mapping of str to int
        Label of each bone to segment; strokes of other labels are background.

    Returns
    -------
    found : dict of str to BoneProbability
        The whole bone, cortex included where its strokes hold it; with its confidence.
    wrong : dict of str to str
        For each of the other bones what is wrong with its strokes, and what to draw.

    Raises
    ------
    InputError
        If the strokes are too few to teach a look.
    ConvergenceError
        If a random walker does not converge.

    References
    ----------
    Grady 2005; Rahimi and Recht 2007.
    """
    known = np.where(np.isin(seeds, [*bones.values(), 0]), seeds, np.uint8(BACKGROUND))
    _check(known)
    drawn = {name: label for name, label in bones.items() if (known == label).any()}
    wrong = dict.fromkeys(bones.keys() - drawn.keys(), "it has no strokes: draw them within the bone")
    lower, upper = _region(known, channels[0])
    crops = [volume.crop(lower, upper) for volume in channels]
    known = known[box(lower, upper)]
    shares, trust = _with_confidence(SharedFeatures(crops, known), known, drawn)
    found = {}
    for name, share in shares.items():
        if not share.claimed.any():
            wrong[name] = "its strokes claim nothing: draw them along both sides of its border"
            logger.warning("%s: %s", name, wrong[name])
            continue
        offset = lower + [s.start for s in share.region]
        found[name] = BoneProbability(offset, share.values.astype(np.float32), trust=tuple(trust[name]))
        logger.info("%s: %s", name, trust[name])
    return found, wrong


class SharedFeatures:
    """What the runs by all and by half of the strokes have in common: the image's features.

    Parameters
    ----------
    channels : sequence of Volume
        Images around the bones.
    seeds : array (nx, ny, nz) of uint8
        All strokes.
    """

    def __init__(self, channels: Sequence[Volume], seeds: Labels) -> None:
        self.spacing = channels[0].spacing
        drawn = (seeds > 0) & (seeds < BACKGROUND)
        near = ndimage.distance_transform_edt(~drawn, sampling=self.spacing) < REACH
        self.at = near | (seeds > 0)
        self.images = np.stack([relative(volume) for volume in channels])
        self.features = features(channels, self.at)

    def shares(self, seeds: Labels, bones: Mapping[str, int], nearby: float = NEARBY) -> dict[str, BoneShare]:
        """Shares of all bones by some of the strokes."""
        marks = seeds[self.at]
        drawn = marks > 0
        look = np.zeros(seeds.shape, np.float32)
        learned = learn(self.features[drawn], marks[drawn] < BACKGROUND, nearby)
        look[self.at] = learned.probability(self.features)
        present = {name: label for name, label in bones.items() if (marks == label).any()}
        return compete(self.images, look, seeds, self.spacing, present)


def _with_confidence(
    scene: SharedFeatures, seeds: Labels, bones: Mapping[str, int]
) -> tuple[dict[str, BoneShare], dict[str, Confidence]]:
    """Shares by all strokes, and how far they are those by half of the strokes."""
    shares = scene.shares(seeds, bones)
    kept = halves(seeds, scene.spacing)
    parts = [labelled(scene.shares(half, bones), seeds.shape) for half in kept]
    plain = labelled(scene.shares(seeds, bones, nearby=0.0), seeds.shape)
    runs = Runs(seeds, labelled(shares, seeds.shape), plain, kept, (parts[0], parts[1]))
    return shares, {name: confidence(runs, label, scene.spacing) for name, label in bones.items()}


def _region(seeds: Labels, volume: Volume) -> tuple[IntArray, IntArray]:
    """First voxel and the one after the last of the box around the bones' strokes."""
    index = np.argwhere((seeds > 0) & (seeds < BACKGROUND))
    reach = np.ceil(REACH / volume.spacing).astype(np.int64)
    lower = np.maximum(index.min(axis=0) - reach, 0)
    return lower, np.minimum(index.max(axis=0) + 1 + reach, volume.shape)


def _check(seeds: Labels) -> None:
    """Raise `InputError` where strokes teach no look of bone, or none of the background."""
    outside = seeds == BACKGROUND
    for which, strokes in (("bones", (seeds > 0) & ~outside), ("background", outside)):
        count = int(np.count_nonzero(strokes))
        if count < FEWEST:
            problem = f"strokes of the {which} have {count} voxels, which teach no look"
            raise InputError("seeds", "strokes", problem, "Draw strokes in every tissue beside the bones")
