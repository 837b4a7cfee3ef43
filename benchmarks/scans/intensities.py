"""A rigid registration of two images in one region, by intensities alone: a reference without surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import SimpleITK as sitk
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import Array, BoolArray, RigidTransform
from handpipe.imaging.volumes import Volume

GROWN = 2  # voxels of other tissue around a bone that the region takes: cortex, and what lies on it
STEP, LEAST_STEP, STEPS = 1.0, 1e-5, 300  # of the descent, in mm and in mm at the region's rim
BLURS = (2.0, 1.0, 0.0)  # voxels, coarse to fine
FEW, FOLLOWED = 7, 3  # one of so many voxels tells which starts are followed
EVERY = (3, 2, 1)  # voxels along an axis, of these levels


@dataclass(frozen=True)
class Match:
    """A rigid motion that carries the fixed image's region onto the moving image, and their correlation."""

    motion: RigidTransform
    correlation: float


def registered(fixed: Volume, moving: Volume, region: BoolArray, starts: list[RigidTransform]) -> Match:
    """The motion of the best correlation in a region (nx, ny, nz) of the fixed image."""
    mask = ndimage.binary_dilation(region, iterations=GROWN)
    still, other = _image(fixed), _image(moving)
    where = _image(fixed.like(mask), sitk.sitkUInt8)
    middle = fixed.to_world(np.argwhere(mask).mean(axis=0)[None])[0]
    places = fixed.to_world(np.argwhere(mask)[::FEW])
    seen = fixed.sample(places)
    blurred = moving.like(ndimage.gaussian_filter(moving.values, BLURS[0]))
    alike = [np.corrcoef(seen, blurred.sample(start(places)))[0, 1] for start in starts]
    best = np.argsort(alike)[::-1][:FOLLOWED]
    matches = [_descent(still, other, where, middle, starts[i]) for i in best]
    return max(matches, key=lambda match: match.correlation)


def _descent(
    fixed: sitk.Image, moving: sitk.Image, mask: sitk.Image, middle: Array, start: RigidTransform
) -> Match:
    """From one start down to a minimum of the negative correlation, on ever finer images."""
    initial = sitk.VersorRigid3DTransform()
    initial.SetCenter(tuple(middle))
    initial.SetMatrix(tuple(start.rotation.ravel()))
    initial.SetTranslation(tuple(start(middle) - middle))
    method = sitk.ImageRegistrationMethod()
    method.SetMetricAsCorrelation()
    method.SetMetricFixedMask(mask)
    method.SetInterpolator(sitk.sitkLinear)
    method.SetOptimizerAsRegularStepGradientDescent(STEP, LEAST_STEP, STEPS)
    method.SetOptimizerScalesFromPhysicalShift()
    method.SetShrinkFactorsPerLevel(EVERY)
    method.SetSmoothingSigmasPerLevel(BLURS)
    method.SetSmoothingSigmasAreSpecifiedInPhysicalUnits(False)
    method.SetInitialTransform(initial, inPlace=True)
    method.Execute(fixed, moving)
    rotation = np.array(initial.GetMatrix()).reshape(3, 3)
    moved = np.array(initial.TransformPoint(tuple(middle)))
    return Match(RigidTransform(rotation, moved - rotation @ middle), -float(method.GetMetricValue()))


def _image(volume: Volume, kind: int = sitk.sitkFloat32) -> sitk.Image:
    """A volume as SimpleITK's image in the same world coordinates."""
    image = sitk.Cast(sitk.GetImageFromArray(np.ascontiguousarray(volume.values.T)), kind)
    image.SetSpacing(tuple(volume.spacing))
    image.SetOrigin(tuple(volume.affine[:3, 3]))
    image.SetDirection(tuple((volume.affine[:3, :3] / volume.spacing).ravel()))
    return image


def apart(one: RigidTransform, other: RigidTransform, middle: Array) -> tuple[float, float]:
    """Angle in degrees between two motions, and the distance in mm between where they carry a point (3,)."""
    between = one.rotation.T @ other.rotation
    angle = np.degrees(np.arccos(np.clip((np.trace(between) - 1) / 2, -1, 1)))
    return float(angle), float(np.linalg.norm(one(middle) - other(middle)))


def bends(middle: Array, degrees: NDArray, shifts: list[Array]) -> list[RigidTransform]:
    """Starts: turns about +y through a point (3,), with shifts (3,) after them."""
    found = []
    for angle in np.radians(degrees):
        c, s = np.cos(angle), np.sin(angle)
        rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        found += [RigidTransform(rotation, middle - rotation @ middle + shift) for shift in shifts]
    return found
