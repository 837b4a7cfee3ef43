"""Seeds of a pose from bones that were moved into it: deep in their marrow, and around them."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np
from scipy import ndimage

from handpipe.core import Array, BoolArray, IntArray
from handpipe.core.configuration import Segmentation
from handpipe.imaging.formats.segments import BACKGROUND
from handpipe.imaging.volumes.rasterisation import rasterise
from handpipe.imaging.volumes.volume import Labels, Volume
from handpipe.mesh.surfaces import Distance, Surface

DEEP = 1.4  # voxels inside the marrow
LEAST = 0.6  # of the greatest depth, where the marrow is thinner
THIN = 0.5  # voxels deep, below which a slice needs no seeds
BRIGHT = 0.65  # levels: darker voxels are no marrow
# mm from the outermost grid places inside a whole bone: at least 1 mm outside it
SHELL = (Segmentation().around, 6.5)
AROUND = (3.5, 7.5)  # mm from the marrow: at least 1 mm outside a whole bone
LARGE = 14000.0  # mm^3 of bright tissue that is fat, not marrow
GRID = 1.0  # mm between the places where distances are computed


def propose(
    normalised: Volume,
    marrow: Mapping[int, Surface],
    whole: Mapping[int, Surface],
    unsure: Collection[int] = (),
    distance: float = SHELL[0],
) -> Labels:
    """Seeds of a pose from bones that were moved into it.

    Parameters
    ----------
    normalised : Volume
        Image of the pose in units of the local marrow level.
    marrow, whole : mapping of int to Surface
        Closed surfaces of the marrow and of the whole bone in the pose, world mm, by label.
    unsure : collection of int, optional
        Labels of bones whose place may be wrong. They get no seeds, and since their place is unknown no
        bright voxel is background.
    distance : float, optional
        Distance in mm from the whole bones beyond which voxels are background.

    Returns
    -------
    array (nx, ny, nz) of uint8
        Each bone's label deep in its marrow, 255 around the bones, 0 elsewhere.
    """
    around = _around(normalised, whole, distance)
    if unsure:
        around &= normalised.values < BRIGHT
    seeds = np.where(around, np.uint8(BACKGROUND), np.uint8(0))
    for label, surface in marrow.items():
        if label not in unsure:
            voxels = marrow_core(normalised, surface)
            bright = normalised.values[tuple(voxels.T)] > BRIGHT
            seeds[tuple(voxels[bright].T)] = label
    return seeds


def propose_solids(normalised: Volume, marrow: Mapping[int, IntArray], complete: bool = True) -> Labels:
    """Seeds of a pose from voxels in the marrow of its bones.

    Parameters
    ----------
    normalised : Volume
        Image of the pose in units of the local marrow level.
    marrow : mapping of int to array (n, 3) of int
        Voxels of each bone's marrow by label.
    complete : bool, optional
        Whether these are all bones. If not, no bright voxel is background: it may be another bone's marrow.

    Returns
    -------
    array (nx, ny, nz) of uint8
        Each bone's label in its marrow but for the outer voxels; 255 around the bones, where it is not bright
        or belongs to bright tissue that is larger than any marrow; 0 elsewhere.
    """
    taken = np.zeros(normalised.shape, np.uint8)
    for label, voxels in marrow.items():
        taken[tuple(voxels.T)] = label
    far = ndimage.distance_transform_edt(taken == 0, sampling=normalised.spacing)
    around = (far > AROUND[0]) & (far < AROUND[1]) & _no_marrow(normalised, complete)
    core = ndimage.binary_erosion(taken > 0)
    seeds = np.where(around, np.uint8(BACKGROUND), np.where(core, taken, np.uint8(0)))
    for label, voxels in marrow.items():
        if not (seeds == label).any():
            seeds[tuple(voxels.T)] = label
    return seeds


def _no_marrow(normalised: Volume, complete: bool) -> BoolArray:
    """Voxels that are not bright or, if all bones are known, part of a bright volume larger than marrow."""
    bright = normalised.values > BRIGHT
    if not complete:
        return ~bright
    parts, _ = ndimage.label(bright)
    large = np.bincount(parts.ravel()) * float(np.prod(normalised.spacing)) > LARGE
    large[0] = True
    return np.asarray(large[parts])


def _around(volume: Volume, whole: Mapping[int, Surface], distance: float) -> BoolArray:
    """Voxels (nx, ny, nz) in a shell about all bones, found on a grid of `GRID`."""
    step = _step(volume)
    affine = volume.affine.copy()
    affine[:3, :3] = affine[:3, :3] * step
    affine[:3, 3] = volume.to_world((step - 1)[None] / 2)[0]
    coarse = Volume(volume.values[:: step[0], :: step[1], :: step[2]], affine)
    far = ndimage.distance_transform_edt(rasterise(coarse, whole) == 0, sampling=coarse.spacing)
    shell = (far > distance) & (far < SHELL[1])
    for axis in range(3):
        shell = shell.repeat(step[axis], axis)
    return shell[tuple(slice(0, n) for n in volume.shape)]


def _step(volume: Volume) -> IntArray:
    """Voxels (3,) from one place of the coarse grid to the next."""
    return np.maximum(np.round(GRID / volume.spacing), 1).astype(np.int64)


def marrow_core(volume: Volume, marrow: Surface) -> IntArray:
    """Voxels deep inside a marrow surface, or its deepest ones where it is thin.

    Between the bone's ends, the deepest voxels of every slice across its long axis are included: a random
    walk from one end seldom passes a waist of few voxels.

    Parameters
    ----------
    volume : Volume
        Volume whose grid is used.
    marrow : Surface
        Closed surface of the marrow, in world mm.

    Returns
    -------
    array (n, 3) of int
        Voxel indices; none if no voxel centre lies inside the surface.
    """
    corners = volume.to_index(marrow.vertices)
    lower = np.clip(np.floor(corners.min(axis=0)).astype(np.int64), 0, volume.shape)
    upper = np.clip(np.ceil(corners.max(axis=0)).astype(np.int64) + 1, 0, volume.shape)
    depths = -_distances(volume, marrow, lower, upper)
    voxels = np.argwhere(depths > 0)
    if len(voxels) == 0:
        return voxels + lower
    depth, size = depths[tuple(voxels.T)], float(volume.spacing.max())
    slices = _slices(volume.to_world(voxels), size)
    deepest = np.zeros(slices.max() + 1)
    np.maximum.at(deepest, slices, depth)
    number = np.arange(len(deepest)) + 0.5
    between = size * np.minimum(number, len(deepest) - number) > depth.max()
    wanted = np.where(between & (deepest > THIN * size), deepest, depth.max())
    return voxels[depth > np.minimum(DEEP * size, LEAST * wanted)[slices]] + lower


def _slices(places: Array, thickness: float) -> IntArray:
    """Number (n,) of the slice across the long axis that each place (n, 3) is in."""
    centred = places - places.mean(axis=0)
    along = centred @ np.linalg.eigh(centred.T @ centred)[1][:, -1]
    return np.floor((along - along.min()) / thickness).astype(np.int64)


def share_outside(voxels: IntArray, truth: Labels, label: int) -> float:
    """Share of a bone's voxels that lie outside its true marrow.

    Parameters
    ----------
    voxels : array (n, 3) of int
        Voxel indices.
    truth : array (nx, ny, nz) of uint8
        True labels.
    label : int
        Label of the bone.

    Returns
    -------
    float
        Share in [0, 1]; 1 if there are no voxels.
    """
    return float((truth[tuple(voxels.T)] != label).mean()) if len(voxels) else 1.0


def _distances(volume: Volume, surface: Surface, lower: IntArray, upper: IntArray) -> Array:
    """Signed distances in mm of the voxels lower <= index < upper to a surface, exact within `GRID` of it.

    Farther away they come from a coarse grid: in a waist, that would miss what little depth there is.
    """
    step, distance = _step(volume), Distance(surface)
    shape = (np.maximum(upper - lower - 1, 0) // step) + 2
    places = np.indices(shape).reshape(3, -1).T * step + lower
    coarse = distance.signed(volume.to_world(places))[0].reshape(shape)
    found = _refined(coarse, step, upper - lower)
    near = np.abs(found) < GRID
    found[near] = distance.signed(volume.to_world(np.argwhere(near) + lower))[0]
    return found


def _refined(coarse: Array, step: IntArray, shape: IntArray) -> Array:
    """A field on every step-th voxel made linear between them, axis by axis."""
    for axis in range(3):
        at = np.arange(shape[axis]) / step[axis]
        before = at.astype(np.int64)
        share = np.expand_dims(at - before, [a for a in range(3) if a != axis])
        lower, upper = np.take(coarse, before, axis), np.take(coarse, before + 1, axis)
        coarse = (1 - share) * lower + share * upper
    return coarse
