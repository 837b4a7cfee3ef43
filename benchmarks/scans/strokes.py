"""Strokes of a JSON file as voxels: polylines in slices, by bone and outside."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import nibabel
import numpy as np
from numpy.typing import NDArray

from handpipe.imaging.segmentation import BACKGROUND

AXES = {"i": (2, 1), "j": (0, 2), "k": (0, 1)}  # the coordinates that a slice's points have
STEPS = 8  # points per voxel of a polyline

Lines = Sequence[Sequence[Sequence[float]]]


def write_strokes(strokes: Path, image: Path, seeds: Path) -> dict[str, int]:
    """Write the strokes as a label volume on the grid of an image as it is stored.

    Returns the bones' labels.
    """
    drawn = json.loads(strokes.read_text(encoding="utf-8"))
    stored = nibabel.Nifti1Image.from_filename(image)
    values, labels = rasterised(drawn, stored.shape)
    nibabel.save(nibabel.Nifti1Image(values, stored.affine), seeds)
    return labels


def rasterised(drawn: Mapping, shape: tuple[int, ...]) -> tuple[NDArray[np.uint8], dict[str, int]]:
    """Voxels of all strokes, and the bones' labels."""
    labels = {name: number for number, name in enumerate(drawn["bones"], 1)}
    values = np.zeros(shape, np.uint8)
    for points in _points(drawn["outside"]):
        values[tuple(points.T)] = BACKGROUND
    for name, planes in drawn["bones"].items():
        for points in _points(planes):
            values[tuple(points.T)] = labels[name]
    return values, labels


def _points(planes: Mapping[str, Lines]) -> Iterator[NDArray]:
    """Voxels (n, 3) of each polyline."""
    for plane, lines in planes.items():
        axis, at = "ijk".index(plane[0]), int(plane[1:])
        for line in lines:
            corners = np.asarray(line, float)
            along = np.concatenate([[0], np.cumsum(np.abs(np.diff(corners, axis=0)).max(axis=1))])
            samples = np.linspace(0, along[-1], int(along[-1] * STEPS) + 2)
            points = np.full((len(samples), 3), float(at))
            for column, other in enumerate(AXES[plane[0]]):
                points[:, other] = np.interp(samples, along, corners[:, column])
            points[:, axis] = at
            yield np.round(points).astype(np.int64)
