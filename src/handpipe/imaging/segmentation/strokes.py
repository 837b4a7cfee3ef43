"""Strokes as polylines of voxels, in a small file instead of a label volume."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from handpipe.core import Array, InputError, IntArray, read_text
from handpipe.imaging.formats.nifti import read_nifti
from handpipe.imaging.formats.segments import BACKGROUND
from handpipe.imaging.volumes.volume import Labels

Line = Sequence[Sequence[float]]


class Strokes(NamedTuple):
    """Polylines of voxels (i, j, k): in the marrow of each bone, and outside of all bones."""

    bones: Mapping[str, Sequence[Line]]
    outside: Sequence[Line]


def read_strokes(path: str | Path) -> Strokes:
    """Read strokes from JSON: `{"bones": {name: [[[i, j, k], …], …]}, "outside": [[[i, j, k], …], …]}`.

    Parameters
    ----------
    path : str or Path
        File of the strokes.

    Returns
    -------
    Strokes

    Raises
    ------
    InputError
        If the file is missing or malformed.
    """
    try:
        content = json.loads(read_text(path))
        lines = [*content["outside"], *(line for drawn in content["bones"].values() for line in drawn)]
        if not all(np.asarray(line, float).ndim == 2 and np.shape(line)[1] == 3 for line in lines):
            raise ValueError("a stroke is no list of voxels [i, j, k]")
    except (OSError, ValueError, KeyError, AttributeError, TypeError, IndexError) as error:
        remedy = 'Write {"bones": {name: strokes}, "outside": strokes}, a stroke as [[i, j, k], …]'
        raise InputError(path, "strokes", f"cannot be read ({error})", remedy) from error
    return Strokes(content["bones"], content["outside"])


def painted(source: str | Path, image: str | Path, bones: Mapping[str, int]) -> tuple[Labels, Array]:
    """Strokes as seeds on the grid of the image on which they were drawn, as its file stores it.

    Parameters
    ----------
    source : str or Path
        File of the strokes.
    image : str or Path
        File of the image, NIfTI.
    bones : mapping of str to int
        Label of each bone.

    Returns
    -------
    seeds : array (nx, ny, nz) of uint8
        0 for no stroke, labels of bones, 255 for the background, which counts where lines meet.
    affine : array (4, 4)
        From voxel indices to world units of the image's header (RAS).

    Raises
    ------
    InputError
        If a file is missing or malformed, a stroke is of an unknown bone, or leads out of the image.
    """
    strokes, stored = read_strokes(source), read_nifti(Path(image))
    seeds = np.zeros(stored.values.shape, np.uint8)
    for name in strokes.bones:
        if name not in bones:
            raise InputError(source, f"bones.{name}", "is no bone of the dataset", "Rename the strokes")
    drawn = [(name, bones[name], line) for name, lines in strokes.bones.items() for line in lines]
    for name, label, line in [*drawn, *(("outside", BACKGROUND, line) for line in strokes.outside)]:
        voxels = _voxels(line)
        if (voxels < 0).any() or (voxels >= seeds.shape).any():
            raise InputError(source, name, f"a stroke leads out of {seeds.shape} voxels", "Mend the stroke")
        seeds[tuple(voxels.T)] = label
    return seeds, stored.affine


def _voxels(line: Line) -> IntArray:
    """The voxels (n, 3) along a polyline."""
    corners = np.asarray(line, float)
    steps = np.abs(np.diff(corners, axis=0)).max(axis=1, initial=0.0)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    along = np.linspace(0, at[-1], 2 * int(np.ceil(at[-1])) + 1)
    return np.round(np.stack([np.interp(along, at, c) for c in corners.T], axis=1)).astype(np.int64)
