"""Which learned bones to doubt: those that their strokes do not decide, are cut short or run away."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping

import numpy as np

from handpipe.imaging.learned.confidence import Confidence
from handpipe.imaging.segmentation import Appearance, BoneProbability, claims
from handpipe.imaging.volumes import Volume

logger = logging.getLogger(__name__)


def learned_appearances(volume: Volume, bones: Mapping[str, BoneProbability]) -> dict[str, Appearance]:
    """How learned bones look: their sizes, and whether the volume's border cuts them.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    bones : mapping of str to BoneProbability
        Bones by name.

    Returns
    -------
    dict of str to Appearance
        Appearance by name. Nothing is said of brightness or of a dark shell, which tell nothing here.
    """
    return {name: _appearance(volume, bone) for name, bone in bones.items()}


def _appearance(volume: Volume, bone: BoneProbability) -> Appearance:
    claimed = bone.probability > 0.5
    level = float(np.median(volume.values[bone.slices][claimed])) if claimed.any() else 0.0
    return Appearance(**claims.extent(volume, bone), level=level, relative_level=1.0, enclosed=1.0)


def learned_doubts(bones: Mapping[str, BoneProbability], corrected: Collection[str] = ()) -> dict[str, str]:
    """The bones that their strokes do not decide, with the reasons; each doubt is logged.

    Parameters
    ----------
    bones : mapping of str to BoneProbability
        Bones by name, as `segment_learned` gives them.
    corrected : collection of str, optional
        Bones that a person has accepted by scribbles: their doubts are only logged.

    Returns
    -------
    dict of str to str
        Doubts by bone.
    """
    wrong = {}
    for name, bone in bones.items():
        doubts = Confidence(*bone.trust).doubts() if bone.trust is not None else []
        if doubts:
            logger.warning("%s: doubted, since %s", name, " and ".join(doubts))
            if name not in corrected:
                wrong[name] = " and ".join(doubts)
    return wrong
