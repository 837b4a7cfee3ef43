"""Segmentations of 3D Slicer (.seg.nrrd): segments by name, in layers, on a part of a volume's grid."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handpipe.core import InputError
from handpipe.imaging.formats.nrrd_image import Header, grid, read_header, read_values, spatial_axes
from handpipe.imaging.formats.stored import Stored, reading, spatial_shape

BACKGROUND_NAME = "background"
BACKGROUND = 255  # label of the background in seed volumes


@dataclass(frozen=True)
class FileSegment:
    """`value` in layer `layer` of the file belongs to the segment."""

    name: str
    layer: int
    value: int


def is_segmentation(path: Path) -> bool:
    """Whether a file is one of 3D Slicer's segmentations, by its name."""
    return path.name.lower().endswith(".seg.nrrd")


def segment_names(path: Path) -> list[str]:
    """Names of a segmentation's segments, from its header alone.

    Parameters
    ----------
    path : Path
        Segmentation of 3D Slicer, .seg.nrrd.

    Returns
    -------
    list of str
        In the order of the header.

    Raises
    ------
    InputError
        As `read_nrrd` does of its header.
    """
    header = read_header(path)
    with reading(path, "segmentation"):
        return [segment.name for segment in _segments(header)]


def read_segments(path: Path, bones: Mapping[str, int]) -> Stored:
    """Labels of the segments that are named as bones are, or `background` (255).

    Parameters
    ----------
    path : Path
        Segmentation of 3D Slicer, .seg.nrrd.
    bones : mapping of str to int
        Label of each bone by name.

    Returns
    -------
    Stored
        Labels and affine.

    Raises
    ------
    InputError
        As `read_nrrd` does, for a segment of another name, and for two bones in one voxel.
    """
    header = read_header(path)
    spatial, layers = spatial_axes(path, header)
    shape = spatial_shape(path, [int(header["sizes"][a]) for a in spatial])
    affine = grid(path, header, spatial)
    values = np.moveaxis(read_values(path, header), spatial, (0, 1, 2)).reshape(*shape, -1)
    with reading(path, "segmentation"):
        segments = _segments(header)
    labels = _labels_by_name(path, segments, bones)
    return Stored(_merged(path, values, segments, labels), affine)


def _segments(header: Header) -> list[FileSegment]:
    """Those of the header; files before layers hold the n-th segment in the n-th component as 1."""
    found = []
    for key in header:
        if match := re.fullmatch(r"Segment(\d+)_Name", key):
            number = match[1]
            layer = int(header.get(f"Segment{number}_Layer") or number)
            value = int(header.get(f"Segment{number}_LabelValue") or 1)
            found.append(FileSegment(str(header[key]).strip(), layer, value))
    return found


def _labels_by_name(path: Path, segments: list[FileSegment], bones: Mapping[str, int]) -> list[int]:
    known = {name.casefold(): label for name, label in bones.items()} | {BACKGROUND_NAME: BACKGROUND}
    names = [s.name.casefold() for s in segments]
    unknown = [s.name for s, name in zip(segments, names, strict=True) if name not in known]
    if unknown or not segments:
        listed = ", ".join(map(repr, unknown))
        problem = f"{listed} are no bones of the dataset" if unknown else "there are none"
        remedy = f"Name them {', '.join(bones)} or {BACKGROUND_NAME}"
        raise InputError(path, "segments", problem, remedy)
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(path, "segments", f"several are named {', '.join(twice)}", "Merge or rename them")
    return [known[name] for name in names]


def _merged(path: Path, values: NDArray, segments: list[FileSegment], labels: list[int]) -> NDArray[np.uint8]:
    """One label volume; a voxel belongs to one segment."""
    merged = np.zeros(values.shape[:3], np.uint8)
    names = dict(zip(labels, (s.name for s in segments), strict=True))
    for segment, label in zip(segments, labels, strict=True):
        if segment.layer >= values.shape[3]:
            problem = f"{segment.name} is in layer {segment.layer} of {values.shape[3]}"
            raise InputError(path, "segments", problem, "Export it again")
        mask = values[..., segment.layer] == segment.value
        shared = merged[mask]
        if shared.any():
            other = names[int(shared[shared > 0][0])]
            problem = f"{other} and {segment.name} share {np.count_nonzero(shared)} voxels"
            raise InputError(path, "segments", problem, "Erase one of them there")
        merged[mask] = label
    return merged
