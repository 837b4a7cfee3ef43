"""The marrow that a person's label map shows, or leaves to the image, as what a bone claims."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.core import BoolArray, InputError
from handpipe.imaging.evidence.profiles import sample_profiles
from handpipe.imaging.segmentation.segmentation import SURROUNDINGS, TYPICAL, BoneProbability
from handpipe.imaging.volumes.rasterisation import inside, rasterise
from handpipe.imaging.volumes.volume import Labels, Volume
from handpipe.mesh.surfaces import Surface

Shown = Literal["whole", "marrow"]

CORTEX = 0.1  # of the marrow's level: usual level of cortical bone
DEEP = 1.0  # mm within the bone's surface: marrow reaches deeper, the rim of a generous label does not
LEAST = 0.05  # of a whole bone's volume that is marrow
ACROSS = 1.2  # mm to both sides of a surface within which the image is compared
CLEARLY = 0.1  # of bright tissue: difference across the surfaces that tells marrow from whole bones


def labelled_bone(
    volume: Volume, surface: Surface, shown: Shown, source: str | Path, name: str
) -> BoneProbability:
    """What a bone of a label map claims: its marrow.

    Where the map shows the whole bone, the marrow is what is brighter inside its surface than half-way
    between cortical bone and marrow.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    surface : Surface
        The bone's surface from the label map, in world mm.
    shown : "whole" or "marrow"
        What the surface is the surface of.
    source : str or Path
        The label map, for messages.
    name : str
        The bone, for messages.

    Returns
    -------
    BoneProbability
        Probability in a box around the bone.

    Raises
    ------
    InputError
        Where the bone is smaller than a voxel, or shows no marrow.
    """
    index = volume.to_index(surface.vertices)
    reach = np.ceil(SURROUNDINGS / volume.spacing).astype(np.int64)
    lower = np.maximum(np.floor(index.min(axis=0)).astype(np.int64) - reach, 0)
    local = volume.crop(lower, np.ceil(index.max(axis=0)).astype(np.int64) + 1 + reach)
    within = inside(local, surface)
    if not within.any():
        raise InputError(source, name, "is smaller than a voxel of its volume", "Draw all of the bone")
    if shown == "marrow":
        return BoneProbability(lower, within.astype(np.float32))
    marrow = _bright(local, within)
    if (marrow > 0.5).sum() < LEAST * within.sum():
        problem = "the image shows no marrow in it"
        raise InputError(
            source, name, problem, "Write `labels_show: marrow` if the label map shows marrow alone"
        )
    return BoneProbability(lower, marrow)


def _bright(volume: Volume, within: BoolArray) -> NDArray[np.float32]:
    """Probability (nx, ny, nz) of marrow inside a whole bone."""
    level = float(np.quantile(volume.values[within], TYPICAL))
    share = (volume.values / max(level, 1e-12) - CORTEX) / (1 - CORTEX)
    probability = np.where(within, np.clip(share, 0, 1), 0)
    pieces, count = ndimage.label(probability > 0.5)
    depth = ndimage.distance_transform_edt(within, sampling=volume.spacing)
    deepest = ndimage.maximum(depth, pieces, np.arange(1, count + 1))
    kept = np.isin(pieces, np.flatnonzero(deepest >= min(DEEP, depth.max())) + 1)
    filled = ndimage.binary_fill_holes(kept)
    probability = np.where((pieces > 0) & ~kept, 0, probability)
    return np.where(filled & ~kept, 1 - np.minimum(probability, 0.5), probability).astype(np.float32)


def with_labelled(volume: Volume, seeds: Labels, surfaces: Mapping[int, Surface]) -> Labels:
    """Seeds in which all voxels of the bones of a label map are strokes of these bones.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    seeds : array (nx, ny, nz) of uint8
        Strokes on its grid.
    surfaces : mapping of int to Surface
        Surfaces of the label map's bones in world mm, by label.

    Returns
    -------
    array (nx, ny, nz) of uint8
        No stroke of another bone or of the background is left inside of these bones.
    """
    labelled = rasterise(volume, surfaces)
    return np.where(labelled > 0, labelled, seeds)


def require_shown(volume: Volume, surfaces: Mapping[str, Surface], shown: Shown, source: str | Path) -> None:
    """Check that bones of a label map are what they are said to be, by what the image shows across them.

    Around marrow the image is darker outside, around whole bones inside: the cortex.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    surfaces : mapping of str to Surface
        Surfaces of the label map's bones in world mm, by name.
    shown : "whole" or "marrow"
        What they are said to be the surfaces of.
    source : str or Path
        The label map, for messages.

    Raises
    ------
    InputError
        Where the image clearly shows that they are the other.
    """
    rises = [_rise(volume, surface) for surface in surfaces.values()]
    rise = float(np.median(rises)) / max(volume.bright, 1e-12) if rises else 0.0
    found = "whole" if rise > 0 else "marrow"
    if abs(rise) > CLEARLY and found != shown:
        where = "inside" if rise > 0 else "outside"
        problem = f"is {shown}, but the image is darker {where} of its bones: they show {found} bone"
        problem = problem.replace("marrow bone", "the marrow").replace("whole bone", "whole bones")
        raise InputError(source, "labels_show", problem, f"Write `labels_show: {found}` beside `labels`")


def _rise(volume: Volume, surface: Surface) -> float:
    """Median change of the darkest intensity near a surface from its inside to its outside."""
    reach = np.linspace(0.25, 1.0, 4) * max(ACROSS, 2 * float(volume.spacing.min()))
    normals = surface.vertex_normals()
    outside, within = (
        sample_profiles(volume, surface.vertices, sign * normals, reach).min(axis=1) for sign in (1, -1)
    )
    return float(np.median(outside - within))
