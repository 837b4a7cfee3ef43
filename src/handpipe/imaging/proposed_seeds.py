"""Seeds of a pose from bones that were moved into it: deep in their marrow, and around them."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from handpipe.imaging.segmentation import BACKGROUND
from handpipe.imaging.volume import Labels, Volume, box
from handpipe.mesh.distance import Distance
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]

DEEP = 1.4  # voxels inside the marrow
LEAST = 0.6  # of the greatest depth, where the marrow is thinner
BRIGHT = 0.65  # levels: darker voxels are no marrow
SHELL = (1.5, 6.0)  # mm outside a whole bone
GRID = 1.0  # mm between the places where distances are computed; they are linear between


def propose(
    normalised: Volume,
    marrow: Mapping[int, Surface],
    whole: Mapping[int, Surface],
    unsure: Collection[int] = (),
) -> Labels:
    """Seeds (nx, ny, nz): each bone's label deep in its marrow, 255 around the bones, else 0.

    normalised: the image in units of the local marrow level; marrow, whole: closed surfaces of the bones in
    the pose, by label; unsure: labels whose place may be wrong. These get no seeds, and as nobody knows
    where they are no bright place is background.
    """
    nearest = np.full(normalised.shape, np.float32(SHELL[1] + 1.0))
    for surface in whole.values():
        region, distance = _distances(normalised, surface, SHELL[1])
        np.minimum(nearest[region], distance, out=nearest[region])
    around = (nearest > SHELL[0]) & (nearest < SHELL[1])
    if unsure:
        around &= normalised.values < BRIGHT
    seeds = np.where(around, np.uint8(BACKGROUND), np.uint8(0))
    for label, surface in marrow.items():
        if label not in unsure:
            voxels = marrow_core(normalised, surface)
            bright = normalised.values[tuple(voxels.T)] > BRIGHT
            seeds[tuple(voxels[bright].T)] = label
    return seeds


def marrow_core(volume: Volume, marrow: Surface) -> NDArray[np.int64]:
    """Voxels (n, 3) deep inside a marrow surface; the deepest ones where it is thin."""
    region, distance = _distances(volume, marrow, 0.0)
    greatest = max(-float(distance.min(initial=0.0)), 0.0)
    deep = distance < -min(DEEP * float(volume.spacing.max()), LEAST * greatest)
    return np.argwhere(deep) + [s.start for s in region]


def share_outside(voxels: NDArray[np.int64], truth: Labels, label: int) -> float:
    """Share of a bone's voxels (n, 3) that lie outside its true marrow; one where there are none."""
    return float((truth[tuple(voxels.T)] != label).mean()) if len(voxels) else 1.0


def _distances(volume: Volume, surface: Surface, margin: float) -> tuple[tuple[slice, slice, slice], NDArray]:
    """Signed distances in mm of the voxels in a box about a surface, and the box."""
    corners, spread = volume.to_index(surface.vertices), margin / volume.spacing
    lower = np.clip(np.floor(corners.min(axis=0) - spread).astype(np.int64), 0, volume.shape)
    upper = np.clip(np.ceil(corners.max(axis=0) + spread).astype(np.int64) + 1, 0, volume.shape)
    step = np.maximum(np.round(GRID / volume.spacing), 1).astype(np.int64)
    shape = (np.maximum(upper - lower - 1, 0) // step) + 2
    places = np.indices(shape).reshape(3, -1).T * step + lower
    coarse = Distance(surface).signed(volume.to_world(places))[0].reshape(shape)
    return box(lower, upper), _refined(coarse, step, upper - lower)


def _refined(coarse: Array, step: NDArray[np.int64], shape: NDArray[np.int64]) -> Array:
    """A field on every step-th voxel made linear between them, axis by axis."""
    for axis in range(3):
        at = np.arange(shape[axis]) / step[axis]
        before = at.astype(np.int64)
        share = np.expand_dims(at - before, [a for a in range(3) if a != axis])
        lower, upper = np.take(coarse, before, axis), np.take(coarse, before + 1, axis)
        coarse = (1 - share) * lower + share * upper
    return coarse
