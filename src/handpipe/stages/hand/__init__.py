"""The whole hand: simulated poses and scenes, their figures, exports, the report."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.hand import (
        evaluate_build,
        evaluate_frames,
        evaluate_poses,
        expand_motion,
        export_obj,
        export_scene,
        report,
        require_frames,
        simulate,
        simulate_flesh,
        simulate_inner,
    )
else:
    __getattr__ = face(__name__)

__all__ = [
    "evaluate_build",
    "evaluate_frames",
    "evaluate_poses",
    "expand_motion",
    "export_obj",
    "export_scene",
    "report",
    "require_frames",
    "simulate",
    "simulate_flesh",
    "simulate_inner",
]
