"""The marrow's surface, below the voxel size: from the walker's probability, refined on the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage import measure

from handpipe.errors import InputError
from handpipe.imaging.dark_layer import DarkLayers, fit_dark_layers
from handpipe.imaging.profiles import graph_laplacian, sample_profiles, smooth_field
from handpipe.imaging.segmentation import BoneProbability, SegmentationSettings
from handpipe.imaging.volume import Volume
from handpipe.mesh.smoothing import taubin
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]

BLUR = 0.5  # voxels: deviation of a voxel's box, 0.29, and of trilinear interpolation, 0.41, together
REACH = 2.0  # voxels that the image may move the walker's surface
USUAL_THICKNESS = 0.6  # mm, of cortical bone in a finger: where fits start
STIFFNESS = 1.0
OUTLIER = 0.25  # mm from the neighbours' face


@dataclass(frozen=True)
class Levels:
    """Intensities near one bone: cortical bone's, and the deviation of the noise."""

    dark: float
    noise: float

    @staticmethod
    def of(volume: Volume, bone: BoneProbability, settings: SegmentationSettings) -> Levels:
        """Estimate from a bone's local region: dark away from edges, noise from second differences."""
        values = volume.values[bone.slices]
        marrow = np.median(values[bone.probability > 0.5])
        dark = ndimage.binary_erosion(values < settings.dark * marrow)
        noise = _noise(values)
        return Levels(float(np.median(values[dark])) if dark.any() else noise, noise)


def _noise(values: NDArray) -> float:
    """Robust deviation of white noise: the median of mixed second differences ignores straight edges."""
    kernel = np.array([1.0, -2.0, 1.0])
    mixed = values.astype(float)
    for axis in range(3):
        mixed = ndimage.convolve1d(mixed, kernel, axis=axis)
    return max(float(np.median(np.abs(mixed)) / 0.6745 / 6**1.5), 1e-6 * float(np.abs(values).max()))


def contour(field: Volume, level: float) -> Surface:
    """Surface where a field crosses a level, larger values inside, facing outwards; largest part, closed."""
    padded = np.pad(field.values, 1, constant_values=float(field.values.min()))
    if not padded.max() > level > padded.min():
        raise InputError("volume", "contour", f"never crosses {level}", "Check seeds and intensities")
    vertices, triangles, _, _ = measure.marching_cubes(padded, level, gradient_direction="ascent")
    surface = Surface(field.to_world(vertices - 1.0), triangles.astype(np.int64)).largest_component()
    return surface if surface.volume() > 0 else surface.flipped()


def marrow_surface(volume: Volume, bone: BoneProbability, settings: SegmentationSettings) -> Surface:
    """Closed smooth surface of a bone's marrow, world mm.

    Starts from the isosurface 0.5 of the probability, then follows the inner face of the dark layer that
    is fitted along its normals, where the image shows it clearly.
    """
    local = volume.crop(bone.offset, bone.offset + bone.probability.shape)
    probability = ndimage.gaussian_filter(bone.probability.astype(np.float32), 0.7)
    surface = taubin(contour(local.like(probability), 0.5), 10)
    levels = Levels.of(volume, bone, settings)
    laplacian = graph_laplacian(surface.triangles, len(surface.vertices))
    for _ in range(2):
        layers, normals = cortical_layers(local, surface, levels, REACH * float(local.spacing.mean()))
        move, _ = smooth_field(laplacian, layers.inner, layers.inner_confidence, STIFFNESS, OUTLIER)
        surface = taubin(surface.moved(surface.vertices + move[:, None] * normals), 5)
    return surface


def cortical_layers(
    volume: Volume, surface: Surface, levels: Levels, reach: float, outwards: float = 2.6
) -> tuple[DarkLayers, Array]:
    """Dark layers fitted along the normals (n, 3) at a marrow surface's vertices, up to `outwards` mm."""
    spacing = float(volume.spacing.mean())
    offsets = np.arange(-reach - 2.5 * spacing, outwards + 1e-9, 0.4 * spacing)
    normals = surface.vertex_normals()
    profiles = sample_profiles(volume, surface.vertices, normals, offsets)
    layers = fit_dark_layers(
        profiles, offsets, levels.dark, BLUR * spacing, levels.noise, reach, USUAL_THICKNESS
    )
    return layers, normals
