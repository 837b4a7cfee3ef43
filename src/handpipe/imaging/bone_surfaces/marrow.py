"""The marrow's surface, below the voxel size: from the walker's probability, refined on the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage import measure

from handpipe.core import Array, InputError
from handpipe.imaging.bone_surfaces.bridges import bridged
from handpipe.imaging.evidence.dark_layer import WINDOW, DarkLayers, fit_dark_layers, fit_dark_level
from handpipe.imaging.evidence.profiles import (
    BLUR,
    graph_laplacian,
    sample_profiles,
    smooth_field,
    summed_curvature,
)
from handpipe.imaging.segmentation.segmentation import BoneProbability
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface, taubin

SMOOTHING = (0.7, 0.35)  # voxels
FADED = 0.9  # of the claimed voxels: with less left, smoothing was too much
WHOLE = 0.98  # of the remaining voxels are connected, or smoothing has cut a waist
REACH = 1.25  # voxels that the image may move the walker's surface
USUAL_THICKNESS = 0.8  # mm, of cortical bone in a finger: where fits start
STIFFNESS = 1.0  # of the marrow's smooth move against a measurement of full confidence
OUTLIER = 0.25  # mm from the neighbours' face
LEVELS = (0.0, 0.25, 0.03)  # of the marrow's level: from, to and step of the levels of cortex that are tried
SAMPLES = 300  # profiles that tell the cortex's level
NORMAL = 0.6745  # median distance from the middle of a normal distribution, over its deviation
PROFILE_STEP = 0.4  # of the shortest edge of a voxel, between samples of a profile


@dataclass(frozen=True)
class Cortex:
    """How cortical bone shows in one image: its level and the marrow's, and the noise's deviation."""

    level: float
    marrow: float
    noise: float

    @staticmethod
    def estimate(volume: Volume, bone: BoneProbability, surface: Surface) -> Cortex:
        """From the profiles across a bone's marrow surface: the level that explains them best."""
        values = volume.values[bone.slices]
        marrow = float(np.median(values[bone.probability > 0.5]))
        noise = _noise(values)
        normals = surface.vertex_normals()
        some = slice(None, None, max(len(normals) // SAMPLES, 1))
        voxel = extent_along(volume, normals[some])
        offsets = profile_offsets(volume, voxel.max())
        profiles = sample_profiles(volume, surface.vertices[some], normals[some], offsets)
        candidates = marrow * np.arange(*LEVELS)
        level = fit_dark_level(profiles, offsets, candidates, BLUR * voxel, noise, voxel, USUAL_THICKNESS)
        return Cortex(level, marrow, noise)


def _noise(values: NDArray) -> float:
    """Robust deviation of white noise: the median of mixed second differences ignores straight edges."""
    kernel = np.array([1.0, -2.0, 1.0])
    mixed = values.astype(float)
    for axis in range(3):
        mixed = ndimage.convolve1d(mixed, kernel, axis=axis)
    return max(float(np.median(np.abs(mixed)) / NORMAL / 6**1.5), 1e-6 * float(np.abs(values).max()))


def contour(field: Volume, level: float) -> Surface:
    """Surface where a field crosses a level, larger values inside, facing outwards; largest part, closed."""
    padded = np.pad(field.values, 1, constant_values=float(field.values.min()))
    if not padded.max() > level > padded.min():
        raise InputError("volume", "contour", f"never crosses {level}", "Check seeds and intensities")
    vertices, triangles, _, _ = measure.marching_cubes(padded, level, gradient_direction="ascent")
    surface = Surface(field.to_world(vertices - 1.0), triangles.astype(np.int64)).largest_component()
    return surface if surface.volume() > 0 else surface.flipped()


def marrow_surface(volume: Volume, bone: BoneProbability) -> Surface:
    """Closed smooth surface of a bone's marrow.

    Starts from the isosurface 0.5 of the probability, then follows the inner face of the dark layer that
    is fitted along its normals, where the image shows it clearly.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    bone : BoneProbability
        Probability of the bone's marrow.

    Returns
    -------
    Surface
        Surface that faces outwards, in world mm; flat where the volume's border cuts the marrow.

    Raises
    ------
    InputError
        If the probability never crosses 0.5.
    ConvergenceError
        If the smooth displacement does not converge.
    """
    local = volume.crop(bone.offset, bone.offset + bone.probability.shape)
    whole = bridged(_smoothed(bridged(bone.probability, local.values)), local.values)
    surface = taubin(contour(local.like(whole), 0.5), 10)
    cortex = Cortex.estimate(local, BoneProbability(np.zeros(3, int), bone.probability), surface)
    laplacian = graph_laplacian(surface.triangles, len(surface.vertices))
    for _ in range(2):
        layers, normals = cortical_layers(local, surface, cortex, REACH)
        move, _ = smooth_field(laplacian, layers.inner, layers.inner_confidence, STIFFNESS, OUTLIER)
        surface = taubin(surface.moved(surface.vertices + move[:, None] * normals), 5)
    return within(volume, surface)


def _smoothed(probability: NDArray[np.float32]) -> NDArray[np.float32]:
    """Probability without the voxels' steps; smoothed less where a bone of few voxels would fade or split."""
    claimed = (probability > 0.5).sum()
    for deviation in SMOOTHING:
        smooth = ndimage.gaussian_filter(probability, deviation)
        sizes = np.bincount(ndimage.label(smooth > 0.5)[0].ravel())[1:]
        if sizes.sum() > FADED * claimed and sizes.max() > WHOLE * sizes.sum():
            return smooth
    return probability


def within(volume: Volume, surface: Surface) -> Surface:
    """The surface with what lies beyond the volume's border flattened on to it: nothing is seen there."""
    index = volume.to_index(surface.vertices)
    seen = np.clip(index, -0.5, np.array(volume.shape) - 0.5)
    return surface if (seen == index).all() else surface.moved(volume.to_world(seen))


def extent_along(volume: Volume, directions: Array) -> Array:
    """A voxel's extent (n,) in mm along unit directions (n, 3): its edge where voxels are cubes."""
    return np.linalg.norm(directions @ volume.affine[:3, :3], axis=1)


def profile_offsets(volume: Volume, reach: float, outwards: float = 2.6) -> Array:
    """Offsets (m,) in mm along a normal: `reach` and the fit's window inwards, `outwards` outwards."""
    window = WINDOW * BLUR * float(volume.spacing.max())
    return np.arange(-reach - window, outwards + 1e-9, PROFILE_STEP * float(volume.spacing.min()))


def cortical_layers(
    volume: Volume, surface: Surface, cortex: Cortex, reach: float, outwards: float = 2.6
) -> tuple[DarkLayers, Array]:
    """Dark layers fitted along the normals at a marrow surface's vertices.

    Blur moves the half-intensity surface of a curved edge by half its variance times the summed curvature, as
    heat flow does. The faces are moved back by that.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    surface : Surface
        Marrow surface in world mm.
    cortex : Cortex
        How cortical bone shows in the image.
    reach : float
        Largest distance of the inner face from the surface, in voxels.
    outwards : float
        Distance in mm outwards to which profiles are sampled.

    Returns
    -------
    layers : DarkLayers
        Faces and confidences at each vertex.
    normals : array (n, 3)
        Outward unit normals at the vertices.
    """
    normals = surface.vertex_normals()
    voxel = extent_along(volume, normals)
    offsets = profile_offsets(volume, reach * float(voxel.max()), outwards)
    profiles = sample_profiles(volume, surface.vertices, normals, offsets)
    blur = BLUR * voxel
    layers = fit_dark_layers(
        profiles, offsets, cortex.level, blur, cortex.noise, reach * voxel, USUAL_THICKNESS
    )
    curvature = summed_curvature(surface)
    outer_curvature = curvature / np.maximum(1 + 0.75 * layers.thickness * curvature, 0.5)
    shift, outer_shift = 0.5 * blur**2 * curvature, 0.5 * blur**2 * outer_curvature
    moved = layers._replace(inner=layers.inner + shift, thickness=layers.thickness + outer_shift - shift)
    return moved, normals
