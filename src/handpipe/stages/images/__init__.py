"""Images, seeds and bones: segmentation of scanned poses."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.images import (
        check_subject,
        correct_bone,
        evaluate_seeds,
        evaluate_segmentation,
        merge_labels,
        paint_strokes,
        prepare_image,
        propose_seeds,
        segment_pose,
        separate_fat_water,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "check_subject",
    "correct_bone",
    "evaluate_seeds",
    "evaluate_segmentation",
    "merge_labels",
    "paint_strokes",
    "prepare_image",
    "propose_seeds",
    "segment_pose",
    "separate_fat_water",
]
