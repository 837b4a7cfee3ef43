"""A skin scan in its own frame, aligned to the skin in the image of its pose, or refused."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.skeleton.scan_alignment.alignment import Alignment, align_scan
    from handpipe.skeleton.scan_alignment.image_skin import ImageSkin
    from handpipe.skeleton.scan_alignment.refusal import limits_used, require_same_hand, require_same_size
    from handpipe.skeleton.scan_alignment.scan_frame import ScanPlace, place_of_scan
else:
    __getattr__ = face(__name__)

__all__ = [
    "Alignment",
    "ImageSkin",
    "ScanPlace",
    "align_scan",
    "limits_used",
    "place_of_scan",
    "require_same_hand",
    "require_same_size",
]
