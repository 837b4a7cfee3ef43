"""The skeleton: registration of bones and the rig."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.stages.skeleton import carry_template, evaluate_registration, fit_rig, register_bones
else:
    __getattr__ = face(__name__)

__all__ = ["carry_template", "evaluate_registration", "fit_rig", "register_bones"]
