"""The shape of an organ from sparse marks, stage by stage: doubts, new tets, resumed fits, files."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.shapes.organs.organ import Observed, fit_organ
else:
    __getattr__ = face(__name__)

__all__ = ["Observed", "fit_organ"]
