"""A bone's surface from its probability alone, where the image's contrast is not that of a dark shell."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from handpipe.imaging.bone_surfaces.marrow import contour, within
from handpipe.imaging.segmentation.segmentation import BoneProbability
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface, taubin

ROUNDS = 10  # of smoothing
MARGIN = 2  # voxels around the bone


def outline_surface(volume: Volume, bone: BoneProbability) -> Surface:
    """Closed smooth surface of a bone where its probability is 0.5.

    Parameters
    ----------
    volume : Volume
        Image of the pose, for its grid.
    bone : BoneProbability
        Probability of the bone.

    Returns
    -------
    Surface
        Surface that faces outwards, in world mm; flat where the volume's border cuts the bone.

    Raises
    ------
    InputError
        If the probability never crosses 0.5.
    """
    local = volume.crop(bone.offset, bone.offset + bone.probability.shape)
    near = ndimage.binary_dilation(bone.probability > 0.5, iterations=MARGIN)
    field = local.like(np.where(near, bone.probability, 0.0))
    return within(volume, taubin(contour(field, 0.5), ROUNDS))
