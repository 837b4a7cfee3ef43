"""What a scanner and a person would give: volumes, scans, seeds of a posed subject."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.acquisition.seeds import draw
else:
    __getattr__ = face(__name__)

__all__ = ["draw"]
