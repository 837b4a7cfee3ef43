"""The whole bone in the neutral pose: its marrow and the dark cortical shell around it.

Tendons and ligaments are as dark as cortical bone, and where they touch it the image shows no edge. The
shell's thickness varies slowly over the bone, so it is measured where the shell's outer face is seen and
carried smoothly over to where a dark neighbour hides it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from handpipe.imaging.marrow import Cortex, contour, cortical_layers
from handpipe.imaging.profiles import graph_laplacian, smooth_field
from handpipe.imaging.segmentation import BoneProbability
from handpipe.imaging.volume import Volume
from handpipe.mesh.distance import Distance
from handpipe.mesh.smoothing import taubin
from handpipe.mesh.surface import Surface

Array = NDArray[np.float64]

THICKEST = 2.2  # mm of cortical bone in a hand
STIFFNESS = 3.0
OUTLIER, OUTLIER_THICKER = 0.3, 0.2  # mm; a dark neighbour only ever thickens the shell


def whole_bone(volume: Volume, bone: BoneProbability, marrow: Surface) -> Surface:
    """Closed smooth surface of marrow and cortical shell, from the marrow's surface, world mm."""
    thickness = shell_thickness(volume, bone, marrow)
    return taubin(offset_surface(marrow, thickness, float(volume.spacing.min())), 5)


def shell_thickness(volume: Volume, bone: BoneProbability, marrow: Surface) -> Array:
    """Thickness (n,) of the cortical shell in mm at the marrow's vertices."""
    cortex = Cortex.estimate(volume, bone, marrow)
    reach = float(volume.spacing.mean())
    layers, _ = cortical_layers(volume, marrow, cortex, reach, outwards=THICKEST + reach)
    outer = layers.inner + layers.thickness
    confidence = layers.thickness_confidence * (outer < THICKEST)
    laplacian = graph_laplacian(marrow.triangles, len(marrow.vertices))
    field, _ = smooth_field(laplacian, outer, confidence, STIFFNESS, OUTLIER, upper_scale=OUTLIER_THICKER)
    return np.clip(field, 0.05, THICKEST)


def offset_surface(surface: Surface, offset: Array, spacing: float) -> Surface:
    """A closed surface moved outwards by offset (n,) > 0 mm, without cutting itself.

    The contour on a grid of `spacing` mm of the signed distance less the offset at the closest point.
    """
    reach = float(offset.max()) + 2 * spacing
    low = surface.vertices.min(0) - reach
    shape = np.ceil((np.ptp(surface.vertices, axis=0) + 2 * reach) / spacing).astype(int) + 1
    affine = np.diag([spacing, spacing, spacing, 1.0])
    affine[:3, 3] = low
    near = np.zeros(shape, bool)
    near[tuple(np.round((surface.vertices - low) / spacing).astype(int).T)] = True
    away = ndimage.distance_transform_edt(~near, sampling=spacing)
    band = np.argwhere(away < reach)
    signed, triangles, closest, _ = Distance(surface).signed(low + spacing * band)
    field = Volume(np.full(shape, -reach, np.float32), affine)
    inside = ndimage.binary_fill_holes(away < 1.5 * spacing)
    field.values[inside] = reach
    field.values[tuple(band.T)] = _at(surface, triangles, closest, offset) - signed
    return contour(field, 0.0)


def _at(surface: Surface, triangles: NDArray[np.int64], points: Array, values: Array) -> Array:
    """Vertex values (n,) interpolated at points (m, 3) on given triangles (m,)."""
    corners = surface.triangles[triangles]
    a, b, c = np.moveaxis(surface.vertices[corners], 1, 0)
    normal = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ij,ij->i", normal, normal), 1e-300)
    weights = np.stack(
        [
            np.einsum("ij,ij->i", np.cross(c - b, points - b), normal) / squared,
            np.einsum("ij,ij->i", np.cross(a - c, points - c), normal) / squared,
            np.einsum("ij,ij->i", np.cross(b - a, points - a), normal) / squared,
        ],
        axis=1,
    )
    return np.einsum("ij,ij->i", weights, values[corners])
