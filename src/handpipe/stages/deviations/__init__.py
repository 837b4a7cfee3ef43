"""Error bars: learned from fits, stated for frames, and compared with true errors."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.deviations import evaluate_deviations, learn_deviations, state_deviations
else:
    __getattr__ = face(__name__)

__all__ = ["evaluate_deviations", "learn_deviations", "state_deviations"]
