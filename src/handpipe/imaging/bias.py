"""Correction of the smooth bias field of an MRI volume (N4, Tustison 2010, by SimpleITK)."""

from __future__ import annotations

import numpy as np
import SimpleITK as sitk

from handpipe.imaging.volume import Volume


def correct_bias(volume: Volume, shrink: int = 4, iterations: int = 30) -> Volume:
    """The volume divided by its bias field, estimated on every `shrink`-th voxel of the foreground."""
    image = sitk.GetImageFromArray(np.ascontiguousarray(volume.values.T))
    image.SetSpacing([float(s) for s in volume.spacing])
    small = sitk.Shrink(image, [shrink] * 3)
    mask = sitk.OtsuThreshold(small, 0, 1, 128)
    filter_ = sitk.N4BiasFieldCorrectionImageFilter()
    filter_.SetMaximumNumberOfIterations([iterations] * 3)
    filter_.Execute(small, mask)
    logarithm = sitk.GetArrayFromImage(filter_.GetLogBiasFieldAsImage(image)).T
    return volume.like(volume.values / np.exp(logarithm))
