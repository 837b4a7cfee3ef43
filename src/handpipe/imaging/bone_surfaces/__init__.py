"""Surfaces of segmented bones below the voxel size: the marrow's, and the whole bone's."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging.bone_surfaces.blurred import blurred_shells
    from handpipe.imaging.bone_surfaces.cortical import whole_bone
    from handpipe.imaging.bone_surfaces.labelled import APART, in_image, labelled_surfaces
    from handpipe.imaging.bone_surfaces.marrow import marrow_surface
    from handpipe.imaging.bone_surfaces.outline import outline_surface
else:
    __getattr__ = face(__name__)

__all__ = [
    "APART",
    "blurred_shells",
    "in_image",
    "labelled_surfaces",
    "marrow_surface",
    "outline_surface",
    "whole_bone",
]
