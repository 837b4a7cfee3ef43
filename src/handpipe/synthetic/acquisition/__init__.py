"""Acquisition of a posed subject: volumes and scans of a scanner, seeds of a person."""

from typing import TYPE_CHECKING

from handpipe.core.faces import face

if TYPE_CHECKING:
    from handpipe.synthetic.acquisition.seeds import draw
else:
    __getattr__ = face(__name__)

__all__ = ["draw"]
