"""Sparse labels as a person would scribble them: short strokes in each bone's marrow and around the bone."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from typing import Any

import nibabel
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, find_objects

from handpipe.core import Array, BoolArray, InputError
from handpipe.core.configuration import Dataset
from handpipe.imaging.segmentation import BACKGROUND
from handpipe.synthetic.acquisition.image import VoxelGrid, write_volume

Labels = NDArray[np.uint8]

STROKES, AROUND = 8, 24  # in a bone, and around it
LENGTH = 6.0  # mm


def scribble(
    marrow: Labels,
    whole: Labels,
    grid: VoxelGrid,
    rng: np.random.Generator,
    strokes: int = STROKES,
    outside: int = AROUND,
    length: float = LENGTH,
) -> Labels:
    """Seeds on the grid: for each label of `marrow`, strokes of the label inside and of 255 around the bone.

    strokes, outside: how many inside and around each bone; length: of a stroke in mm.

    Strokes in marrow keep a voxel's distance from its edge where it is wide enough; those in the background
    lie 1.5 to 6 mm from the bone and at least 1.5 mm from any other.
    """
    seeds = np.zeros(grid.shape, dtype=np.uint8)
    far = distance_transform_edt(whole == 0) * grid.spacing
    for value in np.unique(marrow[marrow > 0]):
        inside = _widest(distance_transform_edt(marrow == value) * grid.spacing, grid.spacing)
        _draw(seeds, inside, int(value), grid, rng, strokes, length)
        near = distance_transform_edt(whole != value) * grid.spacing
        around = (far > 1.5) & (near < 6.0)
        _draw(seeds, around, BACKGROUND, grid, rng, outside, length)
    return seeds


def scribble_locally(
    marrow: Labels,
    whole: Labels,
    grid: VoxelGrid,
    rng: np.random.Generator,
    strokes: int = STROKES,
    outside: int = AROUND,
    length: float = LENGTH,
) -> Labels:
    """As `scribble`, each bone in a box around it: for volumes with many bones."""
    seeds = np.zeros(grid.shape, dtype=np.uint8)
    reach = int(np.ceil(7.0 / grid.spacing))
    for value, box in enumerate(find_objects(whole), 1):
        if box is None or not (marrow[box] == value).any():
            continue
        x, y, z = (slice(max(s.start - reach, 0), s.stop + reach) for s in box)
        local = VoxelGrid(seeds[x, y, z].shape, grid.origin, grid.spacing)
        own = np.where(marrow[x, y, z] == value, marrow[x, y, z], 0)
        drawn = scribble(own, whole[x, y, z], local, rng, strokes, outside, length)
        seeds[x, y, z] = np.where(drawn > 0, drawn, seeds[x, y, z])
    return seeds


def draw(dataset: Dataset, pose: str) -> None:
    """Write the seeds of a generated pose to the file that the dataset names, from its true label volumes.

    Parameters
    ----------
    dataset : Dataset
        Generated subject, whose seed makes the strokes reproducible.
    pose : str
        Name of the pose.

    Raises
    ------
    InputError
        If the dataset names no seeds for the pose or has no truth.
    """
    path = dataset.poses[pose].seeds
    if path is None or dataset.truth is None:
        field = f"poses.{pose}.seeds" if path is None else "truth"
        raise InputError(dataset.name, field, "is not given", "Name it in the dataset file")
    folder = dataset.path(dataset.truth.folder)
    images: list[Any] = [nibabel.load(folder / f"{pose}.{part}.nii.gz") for part in ("bones", "marrow")]
    whole, marrow = (np.asarray(image.dataobj, dtype=np.uint8) for image in images)
    nx, ny, nz = whole.shape
    affine = np.asarray(images[0].affine)
    grid = VoxelGrid((nx, ny, nz), affine[:3, 3], float(affine[0, 0]))
    rng = np.random.default_rng([dataset.seed, zlib.crc32(pose.encode()), 3])
    write_volume(dataset.path(path), scribble_locally(marrow, whole, grid, rng), grid)


def _widest(depth: Array, spacing: float) -> BoolArray:
    """Voxels 1.6 voxels deep or more; where a slice across x has none, its deepest; all where few."""
    deepest = depth.max(axis=(1, 2), keepdims=True)
    wide = (depth >= np.minimum(1.6 * spacing, 0.9 * deepest)) & (depth > spacing)
    return wide if wide.any() else depth > 0


def _draw(
    seeds: Labels,
    allowed: BoolArray,
    value: int,
    grid: VoxelGrid,
    rng: np.random.Generator,
    strokes: int,
    length: float,
) -> None:
    """Straight strokes clipped to the allowed voxels, spread over their longest axis, along or across it."""
    places = np.argwhere(allowed)
    axis = np.linalg.svd(places - places.mean(axis=0), full_matrices=False)[2][0]
    along = places @ axis
    for number, quantile in enumerate((np.arange(strokes) + 0.5) / strokes):
        at = along.min() + quantile * (along.max() - along.min())
        candidates = places[np.abs(along - at) < 2.0]
        if len(candidates) == 0:
            continue
        middle = candidates[rng.integers(len(candidates))]
        direction = rng.standard_normal(3) * (np.arange(3) != rng.integers(3))
        direction = axis if number % 2 == 0 else direction / np.linalg.norm(direction)
        reach = np.arange(-0.5 * length, 0.5 * length, 0.4 * grid.spacing) / grid.spacing
        line = np.unique(np.round(middle + reach[:, None] * direction).astype(int), axis=0)
        line = line[((line >= 0) & (line < grid.shape)).all(axis=1)]
        line = line[allowed[tuple(line.T)]]
        seeds[tuple(line.T)] = value


def majority(occupancies: Mapping[int, Array]) -> Labels:
    """Label volume: each voxel gets the label that fills more than half of it."""
    first = next(iter(occupancies.values()))
    result = np.zeros(first.shape, dtype=np.uint8)
    for value, share in occupancies.items():
        result[share > 0.5] = value
    return result
