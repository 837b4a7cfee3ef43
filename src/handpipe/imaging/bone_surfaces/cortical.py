"""The whole bone in the neutral pose: its marrow and the dark cortical shell around it.

A watershed finds the shell's outer face and tells where it shows: against bright tissue, not against tendons
and ligaments, which are as dark as the shell. There the face is measured below the voxel size by the fitted
dark layer. The shell's thickness varies slowly over the bone and is extrapolated smoothly where no face
shows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handpipe.core import Array
from handpipe.imaging.bone_surfaces.marrow import Cortex, contour, cortical_layers, extent_along, within
from handpipe.imaging.bone_surfaces.shell_watershed import THICKEST, outer_faces, shell_basins
from handpipe.imaging.evidence.profiles import graph_laplacian, smooth_field
from handpipe.imaging.segmentation.segmentation import BoneProbability
from handpipe.imaging.volumes.band import DistanceBand, at_closest
from handpipe.imaging.volumes.volume import Volume
from handpipe.mesh.surfaces import Surface, taubin

STIFFNESS = 0.5  # of the shell's smooth thickness against a measurement of full confidence
OUTLIER, OUTLIER_THICKER = 0.6, 0.5  # mm; a dark neighbour only ever thickens the shell
AGREEMENT = 0.5  # voxels between the watershed's face and the fitted one
UNREFINED = 0.1  # confidence in a face of the watershed that no fit refines
THINNEST = 0.05  # mm of cortical bone


def whole_bone(
    volume: Volume, bone: BoneProbability, marrow: Surface, others: Sequence[Surface] = ()
) -> Surface:
    """Closed smooth surface of a bone's marrow and cortical shell.

    Parameters
    ----------
    volume : Volume
        Image of the pose.
    bone : BoneProbability
        Probability of the bone's marrow.
    marrow : Surface
        Surface of the bone's marrow, in world mm.
    others : sequence of Surface, optional
        Marrow surfaces of the other bones. Dark tissue nearer to them belongs to them.

    Returns
    -------
    Surface
        Surface that faces outwards, in world mm; flat where the volume's border cuts the bone.

    Raises
    ------
    ConvergenceError
        If the smooth field of the shell's thickness does not converge.
    """
    thickness = shell_thickness(volume, bone, marrow, others)
    return within(volume, taubin(offset_surface(marrow, thickness, float(volume.spacing.min())), 5))


def shell_thickness(
    volume: Volume, bone: BoneProbability, marrow: Surface, others: Sequence[Surface] = ()
) -> Array:
    """Thickness (n,) of the cortical shell in mm at the marrow's vertices."""
    cortex = Cortex.estimate(volume, bone, marrow)
    face, confidence = _observed_faces(volume, cortex, marrow, others)
    laplacian = graph_laplacian(marrow.triangles, len(marrow.vertices))
    field, _ = smooth_field(laplacian, face, confidence, STIFFNESS, OUTLIER, upper_scale=OUTLIER_THICKER)
    return np.clip(field, THINNEST, THICKEST)


def _observed_faces(
    volume: Volume, cortex: Cortex, marrow: Surface, others: Sequence[Surface]
) -> tuple[Array, Array]:
    """Offsets (n,) of the shell's outer face along the marrow's normals, and confidences (n,) in [0, 1].

    The watershed decides where the face is; the fitted layer refines it where both agree.
    """
    faces = outer_faces(shell_basins(volume, cortex, marrow, others), marrow)
    outwards = THICKEST + float(volume.spacing.max())
    layers, normals = cortical_layers(volume, marrow, cortex, 1.0, outwards)
    voxel = extent_along(volume, normals)
    fitted = layers.inner + layers.thickness
    agree = np.abs(fitted - faces.offset) < AGREEMENT * voxel
    face = np.where(agree, fitted, faces.offset)
    confidence = np.where(agree, np.maximum(layers.thickness_confidence, UNREFINED), UNREFINED)
    return face, confidence * (faces.seen & (face < THICKEST))


def offset_surface(surface: Surface, offset: Array, spacing: float) -> Surface:
    """A closed surface moved outwards by offset (n,) > 0 mm, without cutting itself.

    The contour on a grid of `spacing` mm of the signed distance less the offset at the closest point.
    """
    reach = float(offset.max()) + 2 * spacing
    shape = np.ceil((np.ptp(surface.vertices, axis=0) + 2 * reach) / spacing).astype(int) + 1
    affine = np.diag([spacing, spacing, spacing, 1.0])
    affine[:3, 3] = surface.vertices.min(0) - reach
    grid = Volume(np.zeros(shape, np.float32), affine)
    band = DistanceBand.around(surface, grid, reach, inwards=2 * spacing)
    field = -band.signed
    field[tuple(band.indices.T)] += at_closest(surface, band.triangles, band.closest, offset)
    return contour(grid.like(field), 0.0)
