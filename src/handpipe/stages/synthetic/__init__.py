"""Generated subjects: templates, images, seeds and truth."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.synthetic import (
        coupled_body,
        coupled_images,
        coupled_pose,
        coupled_templates,
        evaluate_truth,
        generate_pose,
        generate_seeds,
        generate_templates,
        template_hand,
        zanatomy_hand,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "coupled_body",
    "coupled_images",
    "coupled_pose",
    "coupled_templates",
    "evaluate_truth",
    "generate_pose",
    "generate_seeds",
    "generate_templates",
    "template_hand",
    "zanatomy_hand",
]
