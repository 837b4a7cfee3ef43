"""Fat and water of a limb from its echoes."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage.filters import threshold_li

from handpipe.core import Array, BoolArray, InputError
from handpipe.imaging.fat_water.echo_images import EchoImages
from handpipe.imaging.fat_water.echo_signal import Complex, EchoSignal, abs2
from handpipe.imaging.fat_water.field_map import FieldGrid, FieldMap, PossibleFields, field_map
from handpipe.imaging.fat_water.motion import without_motion

log = logging.getLogger(__name__)

SPECK = 20  # voxels: smaller parts of the image that are brighter than air are noise


@dataclass(frozen=True)
class Separated:
    """Fat and water of an image.

    Parameters
    ----------
    water, fat : array (nx, ny, nz)
        Amplitudes in the unit of the magnitudes; noise may make one negative.
    field : array (nx, ny, nz)
        Hz by which the field is off; outside of tissue that of the nearest tissue.
    tissue : array (nx, ny, nz) of bool
        Voxels brighter than air.
    motion : float
        Largest motion of the limb between echoes, in mm; it has been removed.
    residual : float
        Share of the tissue's energy that fat and water do not explain.
    margin : float
        Median of the field by that of the map in which fat and water are exchanged, without signs.
    doubtful : bool
        Whether fat and water may be exchanged in the whole image.
    """

    water: Array
    fat: Array
    field: Array
    tissue: BoolArray
    motion: float
    residual: float
    margin: float
    doubtful: bool


def separate(images: EchoImages) -> Separated:
    """Fat and water by a smooth field map, from two or more echoes with phase.

    Parameters
    ----------
    images : EchoImages
        Echoes of `read_echoes`.

    Returns
    -------
    Separated
        Fat, water, field, and how sure they are.

    Raises
    ------
    InputError
        If nothing is brighter than the rest of the image.
    ConvergenceError
        If echoes cannot be registered to the first one.

    References
    ----------
    Yu 2005 (Magn Reson Med 54, region growing); Hamilton 2011, Bydder 2011 (see `EchoSignal`).
    """
    spacing = images.grid.spacing
    signals, motion = without_motion(images.signals, spacing)
    tissue = _tissue(signals)
    possible = PossibleFields.find(signals, tissue, images.echoes)
    found = field_map(possible, signals[tissue], images.echoes, FieldGrid(tissue.shape, spacing))
    _tell(found)
    nearest = ndimage.distance_transform_edt(~tissue, spacing, return_distances=False, return_indices=True)
    field = np.zeros(tissue.shape)
    field[tissue] = found.field
    field = field[tuple(nearest)]
    water, fat = _amplitudes(signals, field, images.echoes)
    return Separated(water, fat, field, tissue, motion, found.residual, found.margin, found.doubtful)


def _tell(found: FieldMap) -> None:
    log.info(
        "median field %.0f Hz; %.1f %% of the energy unexplained",
        np.median(found.field),
        100 * found.residual,
    )
    if found.doubtful:
        log.warning(
            "fat and water may be exchanged in the whole image: the other map's field is hardly larger "
            "(%.2f of it is this one's); look at the images",
            found.margin,
        )


def _tissue(signals: Complex) -> BoolArray:
    """What is brighter than air, without specks of noise."""
    magnitude = np.sqrt(abs2(signals).mean(axis=-1))
    if magnitude.min() == magnitude.max():
        raise InputError("dixon", "magnitude", "is the same everywhere", "Export the echoes again")
    bright = magnitude > threshold_li(magnitude)
    parts, _ = ndimage.label(bright)
    return np.asarray(bright & (np.bincount(parts.ravel())[parts] >= SPECK))


def _amplitudes(signals: Complex, field: Array, echoes: EchoSignal) -> tuple[Array, Array]:
    """Water and fat, plane by plane, to save memory."""
    water, fat = np.empty(field.shape), np.empty(field.shape)
    for plane in range(len(field)):
        both = echoes.amplitudes(signals[plane].reshape(-1, signals.shape[-1]), field[plane].ravel())
        water[plane], fat[plane] = (part.reshape(field.shape[1:]) for part in both)
    return water, fat
