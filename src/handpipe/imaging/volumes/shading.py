"""A volume without the shading of a receive coil."""

from __future__ import annotations

import numpy as np
import SimpleITK as sitk

from handpipe.imaging.volumes.volume import Volume

AIR = 0.2  # of the median of what is brighter than the mean: darker, smoothed voxels are air
CLOSED = 3  # voxels of dark tissue within the body
COARSE = 2  # voxels along an edge of one on which the field is found
LEVELS = (40, 40, 40, 30)  # iterations of each level of the field's spline


def without_shading(volume: Volume) -> Volume:
    """The volume divided by a smooth field that makes its tissues' histograms sharpest.

    Shading of a coil near the limb may change marrow's level by a factor of three from one end to the other.

    Parameters
    ----------
    volume : Volume
        Image with air around the body.

    Returns
    -------
    Volume
        The same tissues at levels that do not depend on the place; the field's mean over the body is about 1.

    References
    ----------
    Tustison 2010 (N4ITK); the implementation is SimpleITK's.
    """
    image = sitk.GetImageFromArray(volume.values.T)
    image.SetSpacing(tuple(volume.spacing))
    body = _body(image)
    find = sitk.N4BiasFieldCorrectionImageFilter()
    find.SetMaximumNumberOfIterations(LEVELS)
    find.Execute(sitk.Shrink(image, [COARSE] * 3), sitk.Shrink(body, [COARSE] * 3))
    field = sitk.GetArrayFromImage(sitk.Exp(find.GetLogBiasFieldAsImage(image))).T
    return volume.like(volume.values / field)


def _body(image: sitk.Image) -> sitk.Image:
    """Where the body is: bright enough, without holes."""
    values = sitk.GetArrayViewFromImage(image)
    tissue = float(np.median(values[values > values.mean()]))
    smooth = sitk.SmoothingRecursiveGaussian(image, image.GetSpacing())
    mask = sitk.Cast(smooth > AIR * tissue, sitk.sitkUInt8)
    return sitk.BinaryFillhole(sitk.BinaryMorphologicalClosing(mask, [CLOSED] * 3))
