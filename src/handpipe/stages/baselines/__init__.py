"""Other models of the skin, that the full model is compared with."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.baselines import evaluate_baselines, simulate_baselines
else:
    __getattr__ = face(__name__)

__all__ = ["evaluate_baselines", "simulate_baselines"]
