"""Images: volumes in and out, segmentation of bones, and what is measured along profiles."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.imaging import bone_surfaces, evidence, formats, learned, segmentation, volumes
else:
    __getattr__ = face(__name__)

__all__ = ["bone_surfaces", "evidence", "formats", "learned", "segmentation", "volumes"]
