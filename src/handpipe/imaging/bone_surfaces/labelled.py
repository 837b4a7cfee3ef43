"""Smooth surfaces of what a person's label map holds, below its voxel size."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import Array, BoolArray, InputError
from handpipe.imaging.bone_surfaces.marrow import contour, extent_along, within
from handpipe.imaging.evidence.profiles import summed_curvature
from handpipe.imaging.volumes.label_map import LabelMap
from handpipe.imaging.volumes.same_frame import EXPLAINED, likely_cause
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface, taubin

log = logging.getLogger(__name__)

SMOOTHING = (1.0, 0.7, 0.4)  # voxels: deviations of the Gaussian, the first that keeps a mask whole
KEPT = 0.9  # of a mask's voxels that smoothing keeps, in one piece
SPECK = 8  # voxels: smaller pieces are slips of the brush
APART = 3.0  # mm between pieces of one marrow, which a canal thinner than a voxel may join
TOUCHING = np.ones((3, 3, 3), bool)  # voxels of one piece touch by a corner at least


def labelled_surfaces(labels: LabelMap, numbers: Mapping[str, int], apart: float = 0.0) -> dict[str, Surface]:
    """Closed smooth surfaces of labels.

    Parameters
    ----------
    labels : LabelMap
        A person's label map.
    numbers : mapping of str to int
        Labels whose surfaces are wanted, by name.
    apart : float
        Distance in mm up to which pieces of one label are joined; others are refused.

    Returns
    -------
    dict of str to Surface
        Surface in mm by name, in the frame of the image.

    Raises
    ------
    InputError
        Where a label is empty, has voxels in one layer only, or lies in several pieces.
    """
    return {name: labelled_surface(labels.mask(n), labels.source, name, apart) for name, n in numbers.items()}


def in_image(volume: Volume, surface: Surface, source: str | Path, name: str) -> Surface:
    """A label's surface in the image of its pose, flat where the volume's border cuts it.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    surface : Surface
        Surface of the label, in mm.
    source : str or Path
        The label map, for messages.
    name : str
        Name of the label, for messages.

    Returns
    -------
    Surface
        The surface within the volume.

    Raises
    ------
    InputError
        Where it reaches beyond the volume by more than a voxel; the message names the likely cause.
    """
    limits = np.array(volume.shape)

    def seen(matrix: Array) -> float:
        index = volume.to_index(surface.vertices @ matrix.T)
        return float(((index > -1) & (index < limits)).all(axis=1).mean())

    share = seen(np.eye(3))
    if share == 1:
        return within(volume, surface)
    cause = likely_cause(seen, max(EXPLAINED, share))
    remedy = f"It would fit if the file is in {cause}" if cause else "Give the label map of this volume"
    problem = f"{100 * (1 - share):.0f} % of its surface is beyond the volume of its pose"
    raise InputError(source, name, problem, remedy)


def labelled_surface(mask: Volume, source: str | Path, name: str, apart: float = 0.0) -> Surface:
    """Closed smooth surface of a mask.

    A Gaussian takes away the voxels' steps. It moves a curved boundary inwards by half its variance times the
    summed curvature, as heat flow does, and the surface is moved back by that.

    Parameters
    ----------
    mask : Volume
        1 in the mask and 0 outside, with a border of zeros.
    source : str or Path
        File of the mask, for messages.
    name : str
        Name of what is masked, for messages.
    apart : float
        Distance in mm up to which pieces are joined; others are refused.

    Returns
    -------
    Surface
        Surface that faces outwards, in world mm.

    Raises
    ------
    InputError
        Where the mask lies in several pieces.
    """
    solid = ndimage.binary_fill_holes(in_one_piece(mask, source, name, apart))
    deviation, smooth = _smoothed(solid)
    surface = taubin(contour(mask.like(smooth), 0.5), 10)
    normals = surface.vertex_normals()
    shift = 0.5 * (deviation * extent_along(mask, normals)) ** 2 * summed_curvature(surface)
    limit = 0.5 * extent_along(mask, normals)
    return surface.moved(surface.vertices + np.clip(shift, -limit, limit)[:, None] * normals)


def in_one_piece(mask: Volume, source: str | Path, name: str, apart: float) -> BoolArray:
    """A mask (nx, ny, nz) without specks; pieces that are at most `apart` mm from one another are joined."""
    pieces, _ = ndimage.label(mask.values > 0, TOUCHING)
    sizes = np.bincount(pieces.ravel())[1:]
    large = np.flatnonzero(sizes >= min(SPECK, sizes.max())) + 1
    kept = np.isin(pieces, large)
    if stray := int(sizes.sum() - kept.sum()):
        log.warning("%s in %s: %d stray voxels are left out", name, source, stray)
    main = pieces == int(np.argmax(sizes)) + 1
    for piece in sorted(set(large.tolist()) - {int(np.argmax(sizes)) + 1}, key=lambda k: -sizes[k - 1]):
        main |= _joint(mask, main, pieces == piece, source, name, apart) | (pieces == piece)
    return main


def _joint(
    mask: Volume, main: BoolArray, piece: BoolArray, source: str | Path, name: str, apart: float
) -> BoolArray:
    """Voxels (nx, ny, nz) along the shortest line from a piece to the rest."""
    far, nearest = ndimage.distance_transform_edt(~main, sampling=mask.spacing, return_indices=True)
    own = np.argwhere(piece)
    start = own[np.argmin(far[tuple(own.T)])]
    gap = float(far[tuple(start)])
    if gap > apart:
        x, y, z = mask.to_world(own.mean(axis=0)[None])[0]
        place = f"about ({x:.1f}, {y:.1f}, {z:.1f}) mm"
        problem = f"lies in several pieces: {len(own)} voxels {place} are {gap:.1f} mm from the rest"
        raise InputError(source, name, problem, "Erase voxels that are not part of it, or join the pieces")
    end = nearest[(slice(None), *start)]
    along = np.linspace(0, 1, 2 * int(np.abs(end - start).max()) + 1)[:, None]
    line = np.zeros(main.shape, bool)
    line[tuple(np.round(start + along * (end - start)).astype(np.int64).T)] = True
    return np.asarray(ndimage.binary_dilation(line))


def _smoothed(solid: BoolArray) -> tuple[float, NDArray[np.float32]]:
    """The Gaussian's deviation in voxels, and the mask smoothed by it; less where a slim mask would split."""
    for deviation in SMOOTHING:
        smooth = ndimage.gaussian_filter(solid.astype(np.float32), deviation)
        sizes = np.bincount(ndimage.label(smooth > 0.5)[0].ravel())[1:]
        if sizes.sum() and sizes.max() >= KEPT * solid.sum():
            break
    return deviation, smooth
