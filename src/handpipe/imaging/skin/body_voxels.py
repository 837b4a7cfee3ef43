"""Which voxels are in the body: brighter than the air around them and than a share of the tissue nearby."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.filters import threshold_li

from handpipe.core import Array, BoolArray, InputError
from handpipe.imaging.evidence.marrow_evidence import blocks
from handpipe.imaging.volumes.volume import Volume

COARSE = 2.0  # mm, of the fields of levels
NEARBY = 6.0  # mm, deviation of the Gaussian that averages tissue
GHOSTS = 10.0  # mm, deviation of the Gaussian that averages air
CLEAR_OF_BODY = 6.0  # mm
SHARE = 0.2  # of the way from air to the tissue nearby: brighter voxels are in the body
ABOVE_AIR = 2.0  # times the level of air nearby: brighter voxels are in the body, in the smoothed image
SMOOTHED = 0.7  # voxels
EMPTY = 0.999  # of the voxels of a plane are exactly 0: it was not measured
THIN = ndimage.generate_binary_structure(3, 2)  # thinner bridges do not join the body with ghosts
LEAST_AIR = 0.02  # of the voxels
LARGE = 0.02  # of the body's size: other parts that large are named
FAR = 1e-4  # weight of the usual level, which fills what no measurement is near
USUAL = 0.99  # quantile of air: ghosts and spikes are brighter


@dataclass(frozen=True)
class Air:
    """What the image shows where there is nothing: noise, and ghosts of the body.

    Parameters
    ----------
    level : array (nx, ny, nz)
        Mean intensity of air nearby.
    signal : float
        Intensity of air without noise: 0 in a magnitude image.
    noise : float
        Standard deviation of the noise in each of the two channels of a magnitude image.
    """

    level: NDArray[np.float32]
    signal: float
    noise: float

    @staticmethod
    def measure(volume: Volume, rough: BoolArray) -> Air:
        """From the voxels clear of the rough body; voxels of exactly 0 were not measured."""
        reach = np.maximum(np.round(CLEAR_OF_BODY / volume.spacing), 1).astype(int)
        near = ndimage.maximum_filter(rough, size=tuple(int(n) for n in 2 * reach + 1))
        air = ~near & (volume.values > 0)
        if air.mean() < LEAST_AIR:
            air = ~rough & (volume.values > 0)
        if not air.any():
            return Air(np.zeros(volume.shape, np.float32), 0.0, 0.0)
        values = volume.values[air].astype(float)
        usual = values[values <= np.quantile(values, USUAL)]
        mean, deviation = float(usual.mean()), float(usual.std())
        magnitude = mean < 3.0 * deviation  # Rayleigh: 1.91
        signal, noise = (0.0, mean / math.sqrt(math.pi / 2)) if magnitude else (mean, deviation)
        return Air(_local_mean(volume, air, GHOSTS, mean), signal, noise)


@dataclass(frozen=True)
class BodyInVolume:
    """The body in a volume.

    Parameters
    ----------
    inside : array (nx, ny, nz) of bool
        Its voxels, without holes.
    threshold : array (nx, ny, nz)
        Intensity at the body's edge nearby, roughly.
    tissue : array (nx, ny, nz)
        Mean intensity of tissue nearby.
    air : Air
        What is around it.
    others : int
        Other parts in the image that are no dust.
    """

    inside: BoolArray
    threshold: NDArray[np.float32]
    tissue: NDArray[np.float32]
    air: Air
    others: int

    @staticmethod
    def find(volume: Volume) -> BodyInVolume:
        """The largest part of what is brighter than air.

        Raises `InputError` where the image has no body or no air.
        """
        flat = volume.values[:: max(volume.shape[0] // 128, 1)].ravel().astype(float)
        if flat.min() == flat.max():
            raise InputError("volume", "values", f"is {flat.min():g} everywhere", "Export it again")
        rough = volume.values > threshold_li(flat)
        air = Air.measure(volume, rough)
        tissue = _local_mean(volume, rough, NEARBY, float(volume.values[rough].mean()))
        threshold = np.maximum(air.level + SHARE * (tissue - air.level), ABOVE_AIR * air.level)
        bright = filled(ndimage.gaussian_filter(volume.values, SMOOTHED) > threshold)
        labels, count = ndimage.label(ndimage.binary_erosion(bright, THIN, border_value=1))
        if count == 0:
            raise InputError("volume", "values", "show no body brighter than air", "Check the intensities")
        sizes = np.bincount(labels.ravel())[1:]
        core = labels == 1 + int(sizes.argmax())
        inside = filled(bright & ndimage.binary_dilation(core, THIN))
        if inside.all():
            raise InputError("volume", "values", "show no air around the body", "Give a larger field of view")
        return BodyInVolume(inside, threshold, tissue, air, int((sizes > LARGE * sizes.max()).sum()) - 1)


def measured(volume: Volume) -> Volume:
    """The volume without the planes at its border that hold nothing but 0, as scanners pad images."""
    lower, upper = np.zeros(3, int), np.array(volume.shape)
    for axis in range(3):
        rest = tuple(c for c in range(3) if c != axis)
        kept = np.flatnonzero((volume.values == 0).mean(axis=rest) < EMPTY)
        if len(kept):
            lower[axis], upper[axis] = kept[0], kept[-1] + 1
    return volume.crop(lower, upper)


def filled(mask: BoolArray) -> BoolArray:
    """Without holes, those that the border of the image cuts included."""
    out = mask.copy()
    for axis in range(3):
        for side in (0, -1):
            face = (slice(None),) * axis + (side,)
            out[face] = ndimage.binary_fill_holes(out[face])
    return np.asarray(ndimage.binary_fill_holes(out))


def _local_mean(volume: Volume, where: BoolArray, deviation: float, usual: float) -> NDArray[np.float32]:
    """Mean (nx, ny, nz) of the values of some voxels nearby; the usual value far from all of them."""
    steps = np.maximum(np.round(COARSE / volume.spacing), 1).astype(int)
    weights = volume.like(where)
    sums = blocks(volume.like(volume.values * weights.values), steps, np.mean)
    width = deviation / sums.spacing
    weight = ndimage.gaussian_filter(blocks(weights, steps, np.mean).values, width)
    summed = ndimage.gaussian_filter(sums.values, width)
    mean = (summed + FAR * usual) / (weight + FAR)
    return _spread(mean, steps, volume.shape)


def _spread(coarse: Array, steps: Array, shape: tuple[int, int, int]) -> NDArray[np.float32]:
    """A field of blocks at every voxel, linear between the blocks' middles."""
    out = coarse.astype(np.float32)
    for axis, count in enumerate(shape):
        at = np.clip((np.arange(count) - (steps[axis] - 1) / 2) / steps[axis], 0, out.shape[axis] - 1)
        low = np.minimum(at.astype(int), max(out.shape[axis] - 2, 0))
        high = np.minimum(low + 1, out.shape[axis] - 1)
        share = (at - low).astype(np.float32).reshape([-1 if c == axis else 1 for c in range(3)])
        out = np.take(out, low, axis) * (1 - share) + np.take(out, high, axis) * share
    return out
