"""The motion of a limb between echoes that were acquired one after the other."""

from __future__ import annotations

import logging
from itertools import product

import numpy as np
import SimpleITK

from handpipe.core import Array, ConvergenceError
from handpipe.imaging.fat_water.echo_signal import Complex

log = logging.getLogger(__name__)

BINS = 48  # of the histogram of both images' values
STEPS = 100  # of the search, at most
SAMPLES = 150_000  # voxels, at most, that are compared
SMOOTHED = (1.5, 0.0)  # mm, one search after the other
GAIN = 0.03  # of the mutual information, which a motion raises at least
STILL = 0.1  # voxels: a motion below is not removed
FIRST_STEP, LAST_STEP, RELAXATION, FLAT = 0.5, 1e-3, 0.6, 1e-7  # mm and rad over scales, twice; then ratios


def without_motion(signals: Complex, spacing: Array) -> tuple[Complex, float]:
    """Signals (nx, ny, nz, n) as if the limb had been at rest, and the largest motion in mm.

    A rigid motion of each echo from the first is found by mutual information of the magnitudes, since fat
    and water change places in brightness between the echoes (Mattes 2003).
    """
    still, furthest = signals.copy(), 0.0
    fixed = _image(np.abs(signals[..., 0]), spacing)
    for echo in range(1, signals.shape[-1]):
        motion = _registered(fixed, _image(np.abs(signals[..., echo]), spacing), echo)
        distance = _largest_motion(motion, signals.shape[:3], spacing)
        furthest = max(furthest, distance)
        if distance < STILL * spacing.min():
            continue
        log.warning(
            "echo %d: the limb moved by up to %.2f mm since the first echo; removed", echo + 1, distance
        )
        parts = [
            _resampled(part, motion, spacing) for part in (signals[..., echo].real, signals[..., echo].imag)
        ]
        still[..., echo] = parts[0] + 1j * parts[1]
    return still, furthest


def _image(values: Array, spacing: Array) -> SimpleITK.Image:
    image = SimpleITK.GetImageFromArray(np.ascontiguousarray(values.T, dtype=np.float32))
    image.SetSpacing(spacing.tolist())
    return image


def _registered(fixed: SimpleITK.Image, moving: SimpleITK.Image, echo: int) -> SimpleITK.Transform:
    """The motion of an echo from the first one; none where it makes the images hardly more alike."""
    method = SimpleITK.ImageRegistrationMethod()
    method.SetNumberOfThreads(1)  # the same bits in every run
    method.SetMetricAsMattesMutualInformation(BINS)
    method.SetMetricSamplingStrategy(method.REGULAR)
    method.SetMetricSamplingPercentage(min(1.0, SAMPLES / fixed.GetNumberOfPixels()))
    method.SetInterpolator(SimpleITK.sitkLinear)
    geometry = SimpleITK.CenteredTransformInitializerFilter.GEOMETRY
    start = SimpleITK.CenteredTransformInitializer(fixed, moving, SimpleITK.Euler3DTransform(), geometry)
    method.SetInitialTransform(start, inPlace=False)
    method.SetOptimizerAsRegularStepGradientDescent(FIRST_STEP, LAST_STEP, STEPS, RELAXATION, FLAT)
    method.SetOptimizerScalesFromPhysicalShift()
    method.SetShrinkFactorsPerLevel([1] * len(SMOOTHED))
    method.SetSmoothingSigmasPerLevel(SMOOTHED)
    try:
        at_rest = method.MetricEvaluate(fixed, moving)
        found = method.Execute(fixed, moving)
        method.SetInitialTransform(found)
        moved = method.MetricEvaluate(fixed, moving)
    except RuntimeError as error:
        reason = " ".join(str(error).split()).split("ITK ERROR: ")[-1]
        remedy = "Give echoes of one acquisition"
        raise ConvergenceError(f"The registration of echo {echo + 1}", reason, remedy) from error
    return found if -moved > -at_rest * (1 + GAIN) else SimpleITK.Euler3DTransform()


def _largest_motion(motion: SimpleITK.Transform, shape: tuple[int, ...], spacing: Array) -> float:
    """The largest motion of a corner of the image's middle half, in mm."""
    size = spacing * (np.array(shape) - 1)
    corners = size * np.array(list(product((0.25, 0.75), repeat=3)))
    moved = np.array([motion.TransformPoint(corner.tolist()) for corner in corners])
    return float(np.linalg.norm(moved - corners, axis=1).max())


def _resampled(values: Array, motion: SimpleITK.Transform, spacing: Array) -> Array:
    image = _image(values, spacing)
    moved = SimpleITK.Resample(image, image, motion, SimpleITK.sitkLinear, 0.0)
    return np.asarray(SimpleITK.GetArrayFromImage(moved).T, dtype=float)
