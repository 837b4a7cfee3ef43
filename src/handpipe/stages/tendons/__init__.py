"""Tendons: rods in neutral and in poses, hooks."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.tendons import evaluate_tendons, extract_tendon, fit_hooks, register_tendon
else:
    __getattr__ = face(__name__)

__all__ = ["evaluate_tendons", "extract_tendon", "fit_hooks", "register_tendon"]
