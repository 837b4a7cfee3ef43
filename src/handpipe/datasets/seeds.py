"""Sparse labels as a person would scribble them: short strokes in each bone's marrow and around the bone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from handpipe.datasets.image import Grid

Array = NDArray[np.float64]
Labels = NDArray[np.uint8]

BACKGROUND = 255


def scribble(
    marrow: Labels,
    whole: Labels,
    grid: Grid,
    rng: np.random.Generator,
    *,
    strokes: int = 8,
    length: float = 6.0,
) -> Labels:
    """Seeds on the grid: for each label of `marrow`, strokes of the label inside and of 255 around the bone.

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
        _draw(seeds, around, BACKGROUND, grid, rng, 3 * strokes, length)
    return seeds


def _widest(depth: Array, spacing: float) -> NDArray[np.bool_]:
    """Voxels at least 1.6 voxels deep, or where a slice across x has none, its deepest ones."""
    deepest = depth.max(axis=(1, 2), keepdims=True)
    return (depth >= np.minimum(1.6 * spacing, 0.9 * deepest)) & (depth > spacing)


def _draw(
    seeds: Labels,
    allowed: NDArray[np.bool_],
    value: int,
    grid: Grid,
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
