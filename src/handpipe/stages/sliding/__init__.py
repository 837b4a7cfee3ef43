"""The finger whose tissues slide: bodies, poses, images, checks."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.sliding import (
        evaluate_sliding,
        sliding_body,
        sliding_images,
        sliding_pose,
    )
else:
    __getattr__ = face(__name__)

__all__ = ["evaluate_sliding", "sliding_body", "sliding_images", "sliding_pose"]
