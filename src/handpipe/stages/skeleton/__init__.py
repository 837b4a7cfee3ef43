"""The skeleton: registration of bones, the rig, and scans aligned to the image."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.skeleton import (
        align_scan,
        carry_template,
        evaluate_registration,
        fit_rig,
        register_bones,
    )
else:
    __getattr__ = face(__name__)

__all__ = ["align_scan", "carry_template", "evaluate_registration", "fit_rig", "register_bones"]
