"""Pictures of images in motion: planes that follow the bones, slices with contours, side by side."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.evaluation.moved_images.planes import anatomical_planes
    from handpipe.evaluation.moved_images.slices_figure import Row, write_slices
else:
    __getattr__ = face(__name__)

__all__ = ["Row", "anatomical_planes", "write_slices"]
